//! Instances that an association was refused for want of room or a failure of ours: until it sends
//! them again, what it meant to send is not all there.

use std::collections::BTreeSet;

use crate::dicom::uid::SopInstanceUid;

use super::status::{OUT_OF_RESOURCES, PROCESSING_FAILURE, SUCCESS};

/// So many are known by name; of more it is only known that they are.
const MOST: usize = 10_000;

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Missing {
    instances: BTreeSet<String>,
    more: bool,
}

impl Missing {
    /// An instance was answered with `status`.
    pub(super) fn note(&mut self, instance: &str, status: u16) {
        match status {
            SUCCESS => {
                self.instances.remove(instance);
            }
            OUT_OF_RESOURCES | PROCESSING_FAILURE if self.instances.len() < MOST => {
                self.instances.insert(instance.to_owned());
            }
            OUT_OF_RESOURCES | PROCESSING_FAILURE => self.more = true,
            _ => {}
        }
    }

    /// Those that are known by name and have not come again.
    pub(super) fn instances(&self) -> impl Iterator<Item = SopInstanceUid> {
        self.instances.iter().filter_map(|uid| uid.parse().ok())
    }

    /// Whether any has not come again.
    pub(super) fn any(&self) -> bool {
        self.more || !self.instances.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_came_again_is_not_missing_and_other_refusals_are_no_want_of_room() {
        let mut missing = Missing::default();
        missing.note("1.2", OUT_OF_RESOURCES);
        missing.note("1.3", 0xC001);
        assert!(missing.any());
        missing.note("1.2", SUCCESS);
        assert!(!missing.any());
        for instance in 0..=MOST {
            missing.note(&instance.to_string(), OUT_OF_RESOURCES);
        }
        for instance in 0..=MOST {
            missing.note(&instance.to_string(), SUCCESS);
        }
        assert!(missing.any(), "one was not counted by name");
    }
}
