//! A tree of boxes around triangles.

use super::{Closest, Feature, closest_point};
use crate::geometry::{Vec3, dot, sub};

/// Triangles of a leaf.
const LEAF: usize = 4;

/// A box may seem farther than what is in it, by rounding.
const ROUNDING: f64 = 1.0 + 1e-12;

#[derive(Debug, Clone, Copy)]
struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    const NONE: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    fn with(self, p: Vec3) -> Self {
        Self {
            min: [0, 1, 2].map(|axis| self.min[axis].min(p[axis])),
            max: [0, 1, 2].map(|axis| self.max[axis].max(p[axis])),
        }
    }

    /// Squared distance of the place to the box, 0 inside.
    fn squared_distance(&self, p: Vec3) -> f64 {
        let outside = [0, 1, 2].map(|axis| (self.min[axis] - p[axis]).max(p[axis] - self.max[axis]).max(0.0));
        dot(outside, outside)
    }
}

#[derive(Debug)]
enum Kind {
    /// Triangles from `start` to before `end`, in the tree's order.
    Leaf { start: u32, end: u32 },
    /// The left child is the next node.
    Inner { right: u32 },
}

#[derive(Debug)]
struct Node {
    bounds: Bounds,
    kind: Kind,
}

/// Boxes in depth-first order over triangles that were brought into the tree's order.
#[derive(Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    /// Halves the triangles by their centre along the longest axis, until a leaf is left. Also the
    /// tree's order: which triangle is to stand at each place.
    pub(super) fn new(triangles: &[[Vec3; 3]]) -> (Self, Vec<u32>) {
        let count = u32::try_from(triangles.len()).expect("indices of triangles fit into 32 bits");
        let centres: Vec<Vec3> = triangles
            .iter()
            .map(|[a, b, c]| [0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0))
            .collect();
        let mut tree = Self { nodes: Vec::new() };
        let mut order: Vec<u32> = (0..count).collect();
        tree.grow(triangles, &centres, &mut order, 0);
        (tree, order)
    }

    fn grow(&mut self, triangles: &[[Vec3; 3]], centres: &[Vec3], order: &mut [u32], start: u32) {
        let corners = order.iter().flat_map(|&index| triangles[index as usize]);
        let bounds = corners.fold(Bounds::NONE, Bounds::with);
        let node = self.nodes.len();
        let count = u32::try_from(order.len()).expect("no more than all triangles");
        self.nodes.push(Node { bounds, kind: Kind::Leaf { start, end: start + count } });
        if order.len() <= LEAF {
            return;
        }
        let spread = order.iter().map(|&index| centres[index as usize]).fold(Bounds::NONE, Bounds::with);
        let length = |axis: usize| spread.max[axis] - spread.min[axis];
        let axis = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0);
        let half = order.len() / 2;
        let key = |index: u32| centres[index as usize][axis];
        // The index breaks ties, so that the same mesh always gives the same tree.
        order.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let (left, right) = order.split_at_mut(half);
        let middle = start + u32::try_from(half).expect("no more than all triangles");
        self.grow(triangles, centres, left, start);
        let next = u32::try_from(self.nodes.len()).expect("fewer nodes than triangles");
        self.nodes[node].kind = Kind::Inner { right: next };
        self.grow(triangles, centres, right, middle);
    }

    /// The closest point of all triangles, which must be in the tree's order; of equally close ones,
    /// that of the first triangle.
    pub(super) fn closest(&self, triangles: &[[Vec3; 3]], place: Vec3, hint: Option<u32>) -> Closest {
        let mut best =
            Closest { point: place, squared: f64::INFINITY, triangle: u32::MAX, feature: Feature::Face };
        let look = |index: u32, best: &mut Closest| {
            let (point, feature) = closest_point(place, &triangles[index as usize]);
            let apart = sub(place, point);
            let squared = dot(apart, apart);
            if squared < best.squared || (squared == best.squared && index < best.triangle) {
                *best = Closest { point, squared, triangle: index, feature };
            }
        };
        if let Some(hint) = hint.filter(|&hint| (hint as usize) < triangles.len()) {
            look(hint, &mut best);
        }
        // Halving 2³² triangles gives 32 levels, and each leaves one node behind.
        let mut waiting = [(0.0, 0_u32); 40];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (distance, node) = waiting[count];
            // An equally close triangle of a lower index may be in there.
            if distance > best.squared * ROUNDING {
                continue;
            }
            match self.nodes[node as usize].kind {
                Kind::Leaf { start, end } => {
                    (start..end).for_each(|index| look(index, &mut best));
                }
                Kind::Inner { right } => {
                    let child =
                        |index: u32| (self.nodes[index as usize].bounds.squared_distance(place), index);
                    let (near, far) = (child(node + 1), child(right));
                    let (near, far) = if near.0 <= far.0 { (near, far) } else { (far, near) };
                    for child in [far, near] {
                        if child.0 <= best.squared * ROUNDING {
                            waiting[count] = child;
                            count += 1;
                        }
                    }
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles and places without order, from a fixed generator.
    fn scattered(count: usize) -> impl FnMut() -> f64 {
        let mut state = 0x2545_F491_4F6C_DD1D_u64 ^ count as u64;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    #[test]
    fn agrees_with_trying_all_triangles_with_and_without_a_hint() {
        let mut next = scattered(500);
        let mut triangles = Vec::new();
        for _ in 0..500 {
            let origin = [next() * 50.0, next() * 20.0, next() * 80.0];
            let corner = |next: &mut dyn FnMut() -> f64| origin.map(|c| c + next() * 9.0);
            triangles.push([corner(&mut next), corner(&mut next), corner(&mut next)]);
        }
        let (tree, order) = Tree::new(&triangles);
        let triangles: Vec<_> = order.iter().map(|&index| triangles[index as usize]).collect();
        for round in 0..400_u32 {
            let place = [next() * 70.0 - 10.0, next() * 40.0 - 10.0, next() * 100.0 - 10.0];
            let truth = triangles
                .iter()
                .map(|triangle| {
                    let apart = sub(place, closest_point(place, triangle).0);
                    dot(apart, apart)
                })
                .fold(f64::INFINITY, f64::min);
            for hint in [None, Some(round % 500), Some(9999)] {
                assert_eq!(tree.closest(&triangles, place, hint).squared, truth);
            }
        }
    }

    #[test]
    fn many_triangles_in_one_place_are_no_trouble() {
        let triangles = vec![[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]; 5000];
        let closest = Tree::new(&triangles).0.closest(&triangles, [0.2, 0.2, 2.0], Some(77));
        assert_eq!((closest.squared, closest.triangle), (4.0, 0));
    }
}
