//! The nearest point of a surface, and on which side of it a point lies.

use super::{
    Solid, Triangle,
    mesh::{dot, minus, square},
};

/// Triangles in a leaf of the tree.
const LEAF: usize = 4;

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// How far away it is, m.
    pub distance: f64,
    /// Unit vector from inside to outside through it: from or to the point asked for, or where that lies on the surface the
    /// normal of the triangle.
    pub normal: [f64; 3],
    /// Does the point asked for lie inside?
    pub inside: bool,
    /// The triangle; of several at the same distance the first.
    pub triangle: usize,
}

/// Boxes around triangles, each around two others or around a few triangles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

#[derive(Clone, Debug, PartialEq)]
struct Node {
    low: [f64; 3],
    high: [f64; 3],
    /// The second child, the first follows the node; or 0 for a leaf.
    second: u32,
    /// Of a leaf, in `order`.
    first: u32,
    count: u32,
}

/// The part of a triangle that is nearest.
#[derive(Clone, Copy)]
enum Part {
    Face,
    /// From this corner to the next.
    Edge(usize),
    Corner(usize),
}

impl Solid {
    /// The nearest point of the surface made of the triangles that count; none where none does.
    pub fn nearest(&self, x: [f64; 3], counts: impl Fn(usize) -> bool) -> Option<Nearest> {
        let mut best: Option<(f64, usize, [f64; 3], Part)> = None;
        let mut open = vec![(0usize, self.tree.nodes[0].distance2(x))];
        while let Some((n, bound)) = open.pop() {
            if best.is_some_and(|(d2, ..)| bound > d2) {
                continue;
            }
            let node = &self.tree.nodes[n];
            if node.second == 0 {
                for &t in &self.tree.order[node.first as usize..][..node.count as usize] {
                    let t = t as usize;
                    if !counts(t) {
                        continue;
                    }
                    let (point, part) = nearest_of(&self.triangles[t], x);
                    let d2 = square(minus(point, x));
                    if best.is_none_or(|(least, first, ..)| d2 < least || (d2 == least && t < first)) {
                        best = Some((d2, t, point, part));
                    }
                }
            } else {
                let mut children = [n + 1, node.second as usize].map(|c| (c, self.tree.nodes[c].distance2(x)));
                if children[0].1 < children[1].1 {
                    children.swap(0, 1);
                }
                open.extend(children);
            }
        }
        let (d2, triangle, point, part) = best?;
        let (distance, away) = (d2.sqrt(), minus(x, point));
        let side = match part {
            Part::Face => self.normals[triangle],
            Part::Edge(k) => self.of_edges[triangle][k],
            Part::Corner(k) => self.of_corners[triangle][k],
        };
        let inside = dot(away, side) < 0.0;
        // Of a face the normal itself: the difference of two places has lost digits.
        let normal = match part {
            Part::Edge(_) | Part::Corner(_) if distance > 1e-9 * self.size() => {
                away.map(|c| if inside { -c } else { c } / distance)
            }
            _ => self.normals[triangle],
        };
        Some(Nearest { distance, normal, inside, triangle })
    }

    /// Distance to the surface, m, negative inside. Further away than `limit` it may be less, but is never more, nor less than
    /// the limit.
    pub fn distance(&self, x: [f64; 3], limit: f64) -> f64 {
        let around = self.tree.nodes[0].distance2(x).sqrt();
        if around > limit {
            return around;
        }
        let Some(nearest) = self.nearest(x, |_| true) else { return f64::INFINITY };
        if nearest.inside { -nearest.distance } else { nearest.distance }
    }

    /// Does a point lie inside?
    pub fn contains(&self, x: [f64; 3]) -> bool {
        (0..3).all(|a| self.low[a] < x[a] && x[a] < self.high[a]) && self.nearest(x, |_| true).is_some_and(|n| n.inside)
    }

    fn size(&self) -> f64 {
        (0..3).map(|a| self.high[a] - self.low[a]).fold(0.0, f64::max)
    }
}

impl Tree {
    pub fn new(triangles: &[Triangle]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..triangles.len() as u32).collect() };
        tree.split(triangles, 0, triangles.len());
        tree
    }

    /// Makes the node of a part of the order, and those below it.
    fn split(&mut self, triangles: &[Triangle], first: usize, end: usize) {
        let corner = |t: u32, a: usize, k: usize| triangles[t as usize][k][a];
        let fold = |start: f64, of: fn(f64, f64) -> f64, a: usize| {
            let all = self.order[first..end].iter().flat_map(|&t| (0..3).map(move |k| corner(t, a, k)));
            all.fold(start, of)
        };
        let low = [0, 1, 2].map(|a| fold(f64::INFINITY, f64::min, a));
        let high = [0, 1, 2].map(|a| fold(f64::NEG_INFINITY, f64::max, a));
        let at = self.nodes.len();
        self.nodes.push(Node { low, high, second: 0, first: first as u32, count: (end - first) as u32 });
        if end - first <= LEAF {
            return;
        }
        let longest = (0..3).fold(0, |l, a| if high[a] - low[a] > high[l] - low[l] { a } else { l });
        let middle = |t: u32| (0..3).map(|k| corner(t, longest, k)).sum::<f64>();
        self.order[first..end].sort_unstable_by(|&s, &t| middle(s).total_cmp(&middle(t)).then(s.cmp(&t)));
        let half = first + (end - first) / 2;
        self.split(triangles, first, half);
        self.nodes[at].second = self.nodes.len() as u32;
        self.split(triangles, half, end);
    }
}

impl Node {
    /// Squared distance of a point to the box.
    fn distance2(&self, x: [f64; 3]) -> f64 {
        square([0, 1, 2].map(|a| (self.low[a] - x[a]).max(x[a] - self.high[a]).max(0.0)))
    }
}

/// The point of a triangle nearest to `x` (Ericson 2005, Real-Time Collision Detection, section 5.1.5).
fn nearest_of(&[a, b, c]: &Triangle, x: [f64; 3]) -> ([f64; 3], Part) {
    let along = |from: [f64; 3], step: [f64; 3], s: f64| [0, 1, 2].map(|k| from[k] + s * step[k]);
    let (ab, ac) = (minus(b, a), minus(c, a));
    let from = |corner: [f64; 3]| (dot(ab, minus(x, corner)), dot(ac, minus(x, corner)));
    let ((d1, d2), (d3, d4), (d5, d6)) = (from(a), from(b), from(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, Part::Corner(0));
    }
    if d3 >= 0.0 && d4 <= d3 {
        return (b, Part::Corner(1));
    }
    if d6 >= 0.0 && d5 <= d6 {
        return (c, Part::Corner(2));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (along(a, ab, d1 / (d1 - d3)), Part::Edge(0));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (along(a, ac, d2 / (d2 - d6)), Part::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let s = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (along(b, minus(c, b), s), Part::Edge(1));
    }
    let all = va + vb + vc;
    (along(along(a, ab, vb / all), ac, vc / all), Part::Face)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stl::tests::block;

    fn ask(solid: &Solid, x: [f64; 3]) -> Nearest {
        solid.nearest(x, |_| true).unwrap()
    }

    /// A box with a groove along its top: convex and concave edges.
    fn grooved() -> Solid {
        let outline = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [1.5, 0.5], [1.0, 2.0], [0.0, 2.0]];
        let at = |n: usize, y: f64| [outline[n][0], y, outline[n][1]];
        let mut triangles = Vec::new();
        for (p, q) in (0..7).map(|n| (n, (n + 1) % 7)) {
            triangles.push([at(p, 0.0), at(q, 0.0), at(q, 4.0)]);
            triangles.push([at(p, 0.0), at(q, 4.0), at(p, 4.0)]);
        }
        // The ends, from triangles that lie within the outline.
        for [i, j, k] in [[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6]] {
            triangles.push([i, j, k].map(|n| at(n, 4.0)));
            triangles.push([i, k, j].map(|n| at(n, 0.0)));
        }
        Solid::new(triangles).unwrap()
    }

    #[test]
    fn distances_to_a_box_and_normals() {
        let solid = Solid::new(block([0.0; 3], [2.0, 4.0, 6.0])).unwrap();
        let inside = ask(&solid, [1.9, 2.0, 3.0]);
        assert!(inside.inside && (inside.distance - 0.1).abs() < 1e-15 && inside.normal == [1.0, 0.0, 0.0]);
        let outside = ask(&solid, [1.0, 2.0, 6.5]);
        assert!(!outside.inside && outside.distance == 0.5 && outside.normal == [0.0, 0.0, 1.0]);
        let corner = ask(&solid, [3.0, 5.0, 7.0]);
        assert!(!corner.inside && (corner.distance - 3f64.sqrt()).abs() < 1e-15);
        assert!(corner.normal.iter().all(|n| (n - 1.0 / 3f64.sqrt()).abs() < 1e-15));
        assert!(!solid.contains([2.0, 2.0, 2.0]) && solid.contains([1.999, 2.0, 2.0]));
        // Only some triangles count: without those of x the next face is that of y.
        let hidden = solid.nearest([1.9, 3.5, 3.0], |t| t > 3).unwrap();
        assert!(hidden.normal == [0.0, 1.0, 0.0] && (hidden.distance - 0.5).abs() < 1e-15);
        assert_eq!(solid.nearest([0.0; 3], |_| false), None);
        assert!(solid.distance([30.0, 0.0, 0.0], 1.0) >= 28.0 && solid.distance([1.0, 1.0, 1.0], 0.1) == -1.0);
    }

    /// Inside and outside of a shape with a groove, against its outline; distances against all triangles one by one.
    #[test]
    fn the_inside_of_a_groove_is_outside() {
        let solid = grooved();
        assert!((solid.volume - 4.0 * (6.0 - 0.75)).abs() < 1e-12, "{}", solid.volume);
        let mut both = [0, 0];
        for n in 0..4000 {
            let x = [0.5, 0.618_034, 0.414_214].map(|s| (n as f64 * s * 1.37).fract());
            let x = [5.0 * x[0] - 1.0, 6.0 * x[1] - 1.0, 4.0 * x[2] - 1.0];
            let groove = x[2] - 0.5 > 3.0 * (x[0] - 1.5).abs();
            let within = (0.0..3.0).contains(&x[0]) && (0.0..4.0).contains(&x[1]) && (0.0..2.0).contains(&x[2]);
            let found = ask(&solid, x);
            assert_eq!(found.inside, within && !groove, "{x:?}");
            both[usize::from(found.inside)] += 1;
            let all = solid.triangles.iter().map(|t| square(minus(nearest_of(t, x).0, x)).sqrt());
            assert_eq!(found.distance, all.fold(f64::INFINITY, f64::min));
            assert!((square(found.normal) - 1.0).abs() < 1e-12);
        }
        assert!(both.iter().all(|&n| n > 500), "{both:?}");
    }
}
