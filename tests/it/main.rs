//! One binary for all tests that go through the doors that users use.

mod dicom_scan;
mod support;
