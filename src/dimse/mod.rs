//! DICOM in: listener, association, C-ECHO, C-STORE; our own SCU.
