//! What bytes are, by themselves: what a client calls them is often wrong.

/// So many bytes tell what a file is.
pub(super) const HEAD: usize = 512;

/// What a body or file can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Zip,
    Tar,
    Gzip,
    /// One instance, or nothing that we know: the intake tells.
    Instance,
}

/// What a file that begins like this is.
pub(super) fn kind(head: &[u8]) -> Kind {
    if has_part10_prefix(head) {
        Kind::Instance
    } else if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
        Kind::Zip
    } else if head.starts_with(&[0x1f, 0x8b]) {
        Kind::Gzip
    } else if head.get(257..262) == Some(b"ustar") {
        Kind::Tar
    } else {
        Kind::Instance
    }
}

/// Whether a file that begins like this may be a DICOM instance: Part 10 (PS3.10 section 7.1), or
/// one that lost its preamble and begins with group 2 or 8.
pub(super) fn looks_like_dicom(head: &[u8]) -> bool {
    let begins_with_an_early_group = match head.get(..4) {
        Some([0x02 | 0x08, 0x00, _, 0x00] | [0x00, 0x08, 0x00, _]) => true,
        Some(_) | None => false,
    };
    has_part10_prefix(head) || begins_with_an_early_group
}

fn has_part10_prefix(head: &[u8]) -> bool {
    head.get(128..132) == Some(b"DICM")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_preamble_of_an_instance_may_look_like_anything() {
        let mut head = vec![0; 200];
        head[..4].copy_from_slice(b"PK\x03\x04");
        assert_eq!(kind(&head), Kind::Zip);
        head[128..132].copy_from_slice(b"DICM");
        assert_eq!(kind(&head), Kind::Instance);
        assert!(looks_like_dicom(&head));
    }

    #[test]
    fn text_and_resource_forks_are_no_instances() {
        assert!(!looks_like_dicom(b"README"));
        assert!(!looks_like_dicom(&[0x00, 0x05, 0x16, 0x07])); // AppleDouble
        assert!(!looks_like_dicom(b""));
        assert!(looks_like_dicom(&[0x08, 0x00, 0x05, 0x00, b'C', b'S']));
    }
}
