//! One binary for all tests that go through the doors that users use.

mod dicom_decode;
mod dicom_scan;
mod dicom_series;
mod dicom_tables;
mod dimse_association;
mod dimse_conformance;
mod dimse_scu;
mod dimse_store;
mod e2e_bombs;
mod e2e_durability;
mod e2e_empty_cloud;
mod e2e_exactly_once;
mod e2e_protection;
mod e2e_same_bytes;
mod e2e_storage;
mod http_description;
mod http_stow;
mod http_upload;
mod intake_completeness;
mod intake_receipt;
mod published_program_clouds;
mod published_program_points;
mod published_program_slices;
mod store_data_dir;
mod store_queue;
mod support;
