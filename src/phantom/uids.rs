//! Identifiers of a phantom: under 2.25 (PS3.5 B.2), derived from its options.

use uuid::Uuid;

use super::Options;
use crate::dicom::SeriesIdentity;
use crate::dicom::uid::SopInstanceUid;

/// The namespace of all names below.
const NAMESPACE: Uuid = Uuid::from_u128(0x8f0c_5d5e_6d6c_4a37_9d0e_2f6f_1d2b_7a11);

/// Series and frame of reference. Scans of one head lie in one frame of reference, whatever their
/// acquisition: its coordinates are the same.
pub(super) fn identity(options: &Options) -> SeriesIdentity {
    let head = format!("{} {} {} {}", options.seed, options.pitch_deg, options.roll_deg, options.yaw_deg);
    SeriesIdentity {
        study_instance_uid: Some(uid(&format!("study {head}"))),
        series_instance_uid: uid(&format!("series {}", text(options))),
        frame_of_reference_uid: Some(uid(&format!("frame {head}"))),
    }
}

/// The instance of the slice at `index` along the axis of acquisition.
pub(super) fn single_frame(options: &Options, index: usize) -> SopInstanceUid {
    uid(&format!("instance {index} {}", text(options)))
}

/// The Enhanced CT instance.
pub(super) fn multi_frame(options: &Options) -> SopInstanceUid {
    uid(&format!("enhanced {}", text(options)))
}

fn text(options: &Options) -> String {
    serde_json::to_string(options).expect("options are plain numbers and names")
}

fn uid<T: std::str::FromStr>(name: &str) -> T {
    let number = Uuid::new_v5(&NAMESPACE, name.as_bytes()).as_u128();
    let Ok(uid) = format!("2.25.{number}").parse() else {
        unreachable!("2.25 and a number below 2^128 are a UID");
    };
    uid
}
