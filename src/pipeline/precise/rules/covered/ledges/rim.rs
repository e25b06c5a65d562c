//! The rim of a part of the skin.

use crate::pipeline::precise::rules::covered::surface::Surface;

/// How many nodes on the rim of a part stand above what is beside it, below it, or level with it.
#[derive(Debug, Default)]
pub(super) struct Rim {
    /// Links across it, and the sum of how they fall.
    links: u32,
    fall: f32,
    pub(super) above: u32,
    below: u32,
    level: u32,
}

impl Rim {
    /// The rim of some nodes toward those `beside` them; nodes on a ledge are level with nothing. At
    /// the end of the scan no ledge is seen: there they are level with what may follow.
    pub(super) fn of(
        surface: &Surface,
        nodes: &[usize],
        beside: impl Fn(usize) -> bool,
        is_ledge: impl Fn(usize) -> bool,
        at_end: impl Fn(usize) -> bool,
    ) -> Self {
        let mut rim = Self::default();
        for &node in nodes {
            let (mut above, mut below, mut level) = (false, false, at_end(node));
            for link in surface.links(node).filter(|link| beside(link.to)) {
                rim.links += 1;
                rim.fall -= link.rise;
                above |= link.is_ledge() && link.rise < 0.0;
                below |= link.is_ledge() && link.rise > 0.0;
                level |= !link.is_ledge() && !is_ledge(link.to);
            }
            rim.above += u32::from(above);
            rim.below += u32::from(below && !above);
            rim.level += u32::from(level);
        }
        rim
    }

    /// How steeply it falls on average, as a sine.
    pub(super) fn steepness(&self) -> f64 {
        f64::from(self.fall) / f64::from(self.links.max(1))
    }

    /// The share of so many of the rim's nodes.
    pub(super) fn share(&self, nodes: u32) -> f64 {
        f64::from(nodes) / f64::from((self.above + self.below + self.level).max(1))
    }
}
