"""pynetdicom: tiny PDUs, many contexts, an abort in mid-transfer, statuses, release."""
import time
from io import BytesIO

from pydicom.uid import (
    CTImageStorage, DeflatedExplicitVRLittleEndian, EnhancedCTImageStorage, ExplicitVRBigEndian,
    ExplicitVRLittleEndian, ImplicitVRLittleEndian, JPEG2000, JPEG2000Lossless, JPEGBaseline8Bit,
    JPEGLosslessSV1, MRImageStorage, RLELossless,
)
from pynetdicom import AE, build_context
from pynetdicom.dimse_messages import C_STORE_RQ
from pynetdicom.dimse_primitives import C_STORE
from pynetdicom.dsutils import encode
from pynetdicom.pdu_primitives import MaximumLengthNotification
from pynetdicom.sop_class import Verification

from .service import AE_TITLE


def associate(service, contexts, max_pdu=16_382):
    ae = AE('PYNETDICOM')
    ae.acse_timeout = ae.dimse_timeout = ae.network_timeout = 60
    association = ae.associate('127.0.0.1', service.dimse_port, contexts, ae_title=AE_TITLE, max_pdu=max_pdu)
    assert association.is_established, 'the association is not established'
    park(association)
    return association


def park(association):
    """Keeps pynetdicom's own thread from taking the answer that `send_c_store` waits for.

    `send_c_store` pauses that thread by a flag which the thread raises before it really waits, so that on
    a busy machine it may run once more and swallow the answer. Parked for good it can't.
    """
    checkpoint = association._reactor_checkpoint
    checkpoint.set = lambda: None
    checkpoint.clear()
    time.sleep(0.5)


def unpark(association):
    checkpoint = association._reactor_checkpoint
    del checkpoint.set
    checkpoint.set()


def push(association, series):
    return [association.send_c_store(dataset).Status for dataset in series.datasets()]


def release(checks, what, association):
    association.release()
    unpark(association)
    checks.that(f'{what}: released', association.is_released and not association.is_aborted, 'not released')


def run(checks, service, phantom, work, shared):
    tiny_pdus(checks, service, phantom)
    many_contexts(checks, service, phantom)
    big_endian(checks, service, phantom)
    abort_in_mid_transfer(checks, service, phantom)
    statuses(checks, service, phantom)


def tiny_pdus(checks, service, phantom):
    """Fragments of 506 bytes from us, and answers that fit into 128."""
    what = 'pynetdicom, tiny PDUs'
    series = phantom.series('pynetdicom-tiny', ExplicitVRLittleEndian)
    association = associate(service, [build_context(CTImageStorage, ExplicitVRLittleEndian)], max_pdu=128)
    for item in association.acceptor.user_information:
        if isinstance(item, MaximumLengthNotification):
            item.maximum_length_received = 512
    statuses_ = push(association, series)
    checks.equal(f'{what}: {len(series.files)} × 0x0000', set(statuses_), {0})
    release(checks, what, association)
    service.check(checks, what, series)


def many_contexts(checks, service, phantom):
    """128 contexts; accepted, abstract syntax and transfer syntax not supported, each as it should."""
    what = 'pynetdicom, 128 contexts'
    every = [JPEG2000, RLELossless, JPEGLosslessSV1, JPEG2000Lossless, DeflatedExplicitVRLittleEndian,
             ExplicitVRBigEndian, ImplicitVRLittleEndian, ExplicitVRLittleEndian]
    kinds = [(CTImageStorage, every), (CTImageStorage, [ImplicitVRLittleEndian]),
             (EnhancedCTImageStorage, [JPEG2000Lossless]), (MRImageStorage, every),
             (CTImageStorage, [JPEGBaseline8Bit]), (Verification, [ImplicitVRLittleEndian])]
    proposed = [kinds[index % len(kinds)] for index in range(128)]
    association = associate(service, [build_context(*kind) for kind in proposed])
    contexts = association.accepted_contexts + association.rejected_contexts
    answers = {context.context_id: context for context in contexts}
    expected = [0, 0, 0, 3, 4, 0]
    got = [answers[2 * index + 1].result for index in range(128)]
    checks.equal(f'{what}: results', got, [expected[index % len(kinds)] for index in range(128)])
    favourite = {answers[2 * index + 1].transfer_syntax[0] for index in range(0, 128, len(kinds))}
    checks.equal(f'{what}: our favourite syntax is taken', favourite, {ExplicitVRLittleEndian})
    checks.equal(f'{what}: C-ECHO', association.send_c_echo().Status, 0)
    series = phantom.series('pynetdicom-contexts', ImplicitVRLittleEndian)
    checks.equal(f'{what}: {len(series.files)} × 0x0000', set(push(association, series)), {0})
    release(checks, what, association)
    service.check(checks, what, series)


def big_endian(checks, service, phantom):
    what = 'pynetdicom, big endian'
    series = phantom.converted('pynetdicom-big', 'dcmconv', '+tb')
    association = associate(service, [build_context(CTImageStorage, ExplicitVRBigEndian)])
    checks.equal(f'{what}: {len(series.files)} × 0x0000', set(push(association, series)), {0})
    release(checks, what, association)
    checks.equal(f'{what}: transfer syntax', service.stored_syntaxes(series), {ExplicitVRBigEndian})
    service.check(checks, what, series)


def abort_in_mid_transfer(checks, service, phantom):
    what = 'pynetdicom, abort in mid-transfer'
    series = phantom.series('pynetdicom-abort', ExplicitVRLittleEndian)
    datasets = series.datasets()
    association = associate(service, [build_context(CTImageStorage, ExplicitVRLittleEndian)])
    checks.equal(f'{what}: the first instance', association.send_c_store(datasets[0]).Status, 0)
    request = C_STORE()
    request.MessageID = 2
    request.AffectedSOPClassUID = datasets[1].SOPClassUID
    request.AffectedSOPInstanceUID = datasets[1].SOPInstanceUID
    request.Priority = 0
    request.DataSet = BytesIO(encode(datasets[1], False, True))
    message = C_STORE_RQ()
    message.primitive_to_message(request)
    fragments = list(message.encode_msg(association.accepted_contexts[0].context_id, 4_096))
    for fragment in fragments[:len(fragments) // 2]:
        association.dul.send_pdu(fragment)
    association.abort()
    unpark(association)
    checks.that(f'{what}: aborted', association.is_aborted, 'not aborted')
    service.until(lambda: 'aborted_by_peer' in service.log.read_text(), 30, 'the abort was not noticed')
    checks.equal(f'{what}: only what was acknowledged is stored', service.series(series)['instances'], 1)
    # The rest comes over a new association; the half one was not kept.
    association = associate(service, [build_context(CTImageStorage, ExplicitVRLittleEndian)])
    sent = [association.send_c_store(dataset).Status for dataset in datasets[1:]]
    checks.equal(f'{what}: the rest over a new association', set(sent), {0})
    release(checks, what, association)
    view = service.finished(series)
    checks.equal(f'{what}: all instances are stored', view['instances'], len(series.files))
    service.until(lambda: service.cloud(series) == service.reconstructed(series), 60, f'{what}: the cloud differs')
    checks.that(f'{what}: the cloud is that of `triplanar reconstruct`', True)


def statuses(checks, service, phantom):
    what = 'pynetdicom, statuses'
    series = phantom.series('pynetdicom-statuses', ExplicitVRLittleEndian)
    dataset = series.datasets()[0]
    association = associate(service, [build_context(CTImageStorage, ExplicitVRLittleEndian)])
    checks.equal(f'{what}: stored', association.send_c_store(dataset).Status, 0)
    checks.equal(f'{what}: the same again', association.send_c_store(dataset).Status, 0)
    pixels = bytearray(dataset.PixelData)
    pixels[1000] ^= 1
    dataset.PixelData = bytes(pixels)
    answer = association.send_c_store(dataset)
    checks.equal(f'{what}: the same UID with other pixels', hex(answer.Status), '0xc003')
    comment = str(answer.get('ErrorComment', ''))
    checks.that(f'{what}: an Error Comment says why', comment.startswith('conflicting-instance') and len(comment) <= 64,
                comment)
    release(checks, what, association)
    checks.equal(f'{what}: the refused instance stands in the series', service.series(series)['refused_instances'], 1)
