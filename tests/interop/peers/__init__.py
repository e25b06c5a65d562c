"""Real DICOM peers against a running service; see ../peers.sh."""
