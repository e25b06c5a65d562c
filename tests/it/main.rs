//! One binary for all tests that go through the doors that users use.

mod dicom_scan;
mod dimse_association;
mod dimse_scu;
mod dimse_store;
mod support;
