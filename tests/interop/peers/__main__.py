"""Runs every peer against one service: python -m peers TRIPLANAR WORKDIR [SHARED]."""
import sys
from pathlib import Path

from . import dcmtk, dicomweb, orthanc, pynetdicom_peer, shared_series
from .checks import Checks
from .series import Phantom
from .service import Service


def main() -> int:
    triplanar, work = Path(sys.argv[1]), Path(sys.argv[2])
    shared = Path(sys.argv[3]) / 'data' if len(sys.argv) > 3 else None
    checks = Checks()
    phantom = Phantom(triplanar, work)
    with Service(triplanar, work / 'service') as service:
        peers = [dcmtk, pynetdicom_peer, orthanc, dicomweb]
        if shared is not None and shared.is_dir():
            peers.append(shared_series)
        else:
            print('ignored: real series: no shared data')
        for peer in peers:
            with checks.no_exception(peer.__name__):
                peer.run(checks, service, phantom, work, shared)
        checks.that('no patient identity in the log', not service.log_names(phantom.patient_identity()),
                    'the log holds a patient name or ID')
    print(f'{checks.passed} passed, {checks.failed} failed')
    return 1 if checks.failed else 0


sys.exit(main())
