//! `triplanar` turns a head CT into the patient's skin as a point cloud, in DICOM patient
//! coordinates (LPS, mm).
//!
//! The modules, in the order in which data flows:
//!
//! | module | what it does |
//! |---|---|
//! | [`config`] | settings: compiled-in defaults ← file ← environment ← flags |
//! | [`crowd`] | nobody locks others out: limits per peer, who makes room, least rates, descriptors |
//! | [`dimse`] | DICOM in: listener, association, C-ECHO, C-STORE; our own SCU |
//! | [`http`] | REST, STOW-RS and upload in; clouds, reports, events, health and metrics out |
//! | [`intake`] | makes an instance durable, groups it into its series, notices that a series is complete |
//! | [`store`] | the catalog (SQL) and the blobs (files) |
//! | [`jobs`] | the durable queue and its workers |
//! | [`dicom`] | bounded scan, decoding, series → [`dicom::Volume`] |
//! | [`geometry`] | voxel index ↔ LPS mm, planes and frames |
//! | [`pipeline`] | [`dicom::Volume`] → skin: the paper, one file a step; `precise`, five stages |
//! | [`cloud`] | [`cloud::PointCloud`] and its formats |
//! | [`reconstruction`] | the whole way from instances to clouds and report, without a service |
//! | [`evaluation`] | the paper's evaluation: a cloud against the truth, ICP, any cloud or mesh file |
//! | [`render`] | pictures of clouds |
//! | [`phantom`] | a synthetic head CT whose skin is known exactly |
//! | [`cli`] | the command line |
//! | [`error`] | what can be refused, and its one mapping to DIMSE status and problem+json |
//! | [`observer`] | watches what takes long, and stops it |
//! | [`memory`] | the one budget of memory for jobs, decoding and answers |
//! | [`telemetry`] | metrics and log set-up |
//! | [`service`] | starts all of it, stops all of it |
//!
//! `geometry`, `dicom`, `pipeline`, `cloud`, `evaluation`, `render`, `phantom` and `reconstruction` are
//! plain synchronous code. Only `dimse`, `intake`, `jobs`, `store`, `http` and `service` know tokio.
//!
//! Where to add: a rejection rule → `pipeline/paper/rules/`, `pipeline/precise/rules/`; a cloud format →
//! `cloud/formats/`; a DIMSE service → `dimse/services/`; another database → `store/catalog/`.

pub mod cli;
pub mod cloud;
pub mod config;
pub mod crowd;
pub mod dicom;
pub mod dimse;
pub mod error;
pub mod evaluation;
pub mod geometry;
pub mod http;
pub mod intake;
pub mod jobs;
pub mod memory;
mod named;
pub mod observer;
pub mod phantom;
pub mod pipeline;
pub mod reconstruction;
pub mod render;
pub mod service;
pub mod store;
pub mod telemetry;

/// The software's name and version as it stands in clouds, reports and the
/// Implementation Version Name of DICOM.
pub const SOFTWARE: &str = concat!("triplanar ", env!("CARGO_PKG_VERSION"));
