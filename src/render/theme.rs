//! Colours around the clouds.

use image::Rgb;

/// Background and what is written on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Theme {
    /// White.
    Light,
    /// Nearly black.
    Dark,
}

impl Theme {
    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Light => "light",
            Self::Dark => "dark",
        }
    }

    pub(super) fn background(self) -> Rgb<u8> {
        match self {
            Self::Light => Rgb([255, 255, 255]),
            Self::Dark => Rgb([18, 20, 24]),
        }
    }

    pub(super) fn ink(self) -> Rgb<u8> {
        match self {
            Self::Light => Rgb([32, 36, 44]),
            Self::Dark => Rgb([228, 230, 234]),
        }
    }

    /// For what is not to be in the foreground.
    pub(super) fn faint(self) -> Rgb<u8> {
        match self {
            Self::Light => Rgb([120, 126, 136]),
            Self::Dark => Rgb([140, 146, 156]),
        }
    }
}
