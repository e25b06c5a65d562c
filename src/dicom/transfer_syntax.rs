//! The transfer syntaxes that can be decoded here, in our order of preference.

use dicom_dictionary_std::uids;

use super::scan::Layout;
use super::uid::TransferSyntaxUid;

/// A transfer syntax (PS3.5 annex A) that we accept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TransferSyntax {
    /// Its UID.
    pub uid: &'static str,
    /// Its name in PS3.6 annex A.
    pub name: &'static str,
    /// Whether it may have lost information of the pixels.
    pub lossy: bool,
}

/// Retired from the standard, still in archives.
const BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";

const fn lossless(uid: &'static str, name: &'static str) -> TransferSyntax {
    TransferSyntax { uid, name, lossy: false }
}

const fn lossy(uid: &'static str, name: &'static str) -> TransferSyntax {
    TransferSyntax { uid, name, lossy: true }
}

/// All of them, the preferred one first: uncompressed ones, then compressed ones, those that may
/// be lossy last.
pub const SUPPORTED: &[TransferSyntax] = &[
    lossless(uids::EXPLICIT_VR_LITTLE_ENDIAN, "Explicit VR Little Endian"),
    lossless(uids::IMPLICIT_VR_LITTLE_ENDIAN, "Implicit VR Little Endian"),
    lossless(BIG_ENDIAN, "Explicit VR Big Endian (Retired)"),
    lossless(uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN, "Deflated Explicit VR Little Endian"),
    lossless(uids::RLE_LOSSLESS, "RLE Lossless"),
    lossless(
        uids::JPEG_LOSSLESS_SV1,
        "JPEG Lossless, Non-Hierarchical, First-Order Prediction (Process 14 [Selection Value 1])",
    ),
    lossless(uids::JPEG_LOSSLESS, "JPEG Lossless, Non-Hierarchical (Process 14)"),
    #[cfg(feature = "jpegls")]
    lossless(uids::JPEGLS_LOSSLESS, "JPEG-LS Lossless Image Compression"),
    lossless(uids::JPEG2000_LOSSLESS, "JPEG 2000 Image Compression (Lossless Only)"),
    lossless(uids::HTJ2K_LOSSLESS, "High-Throughput JPEG 2000 Image Compression (Lossless Only)"),
    lossless(
        uids::HTJ2K_LOSSLESS_RPCL,
        "High-Throughput JPEG 2000 with RPCL Options Image Compression (Lossless Only)",
    ),
    #[cfg(feature = "jpegls")]
    lossy(uids::JPEGLS_NEAR_LOSSLESS, "JPEG-LS Lossy (Near-Lossless) Image Compression"),
    lossy(uids::JPEG2000, "JPEG 2000 Image Compression"),
    lossy(uids::HTJ2K, "High-Throughput JPEG 2000 Image Compression"),
];

/// The supported one with that UID.
#[must_use]
pub fn find(uid: &TransferSyntaxUid) -> Option<&'static TransferSyntax> {
    SUPPORTED.iter().find(|syntax| syntax.uid == uid.as_str())
}

impl TransferSyntax {
    /// Its UID, typed.
    #[must_use]
    pub fn uid(&self) -> TransferSyntaxUid {
        self.uid.parse().expect("the table holds valid UIDs")
    }

    pub(crate) fn deflated(&self) -> bool {
        self.uid == uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN
    }

    pub(crate) fn layout(&self) -> Layout {
        match self.uid {
            uids::IMPLICIT_VR_LITTLE_ENDIAN => Layout::IMPLICIT,
            BIG_ENDIAN => Layout::BIG_ENDIAN,
            _ => Layout::EXPLICIT,
        }
    }
}
