//! A closed surface of triangles.

use super::{Triangle, nearest::Tree};
use std::collections::{BTreeMap, HashMap};

/// Corners nearer to each other than this fraction of the size of the whole are one.
const SAME: f64 = 1e-6;

/// A solid body within a closed surface of triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<Triangle>,
    /// Corners of the box around it, m.
    pub low: [f64; 3],
    /// See `low`.
    pub high: [f64; 3],
    /// Volume, m3.
    pub volume: f64,
    /// Unit normals outwards: of the triangles, and of their edges and corners, by which the inside is told.
    pub(super) normals: Vec<[f64; 3]>,
    pub(super) of_edges: Vec<[[f64; 3]; 3]>,
    pub(super) of_corners: Vec<[[f64; 3]; 3]>,
    pub(super) tree: Tree,
}

impl Solid {
    /// Checks that the surface is closed and its triangles have areas. Inside out it is turned around.
    ///
    /// # Errors
    /// What is wrong, where, and what would be right.
    pub fn new(triangles: Vec<Triangle>) -> Result<Self, String> {
        let (low, high) = bounds(&triangles);
        let size = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let mut joined = Joined::of(&triangles, 0.0);
        if joined.fault().is_some() {
            // Programs that write few digits do not always write the same ones.
            joined = Joined::of(&triangles, SAME * size);
        }
        if let Some(fault) = joined.fault() {
            return Err(fault);
        }
        let mut triangles = joined.triangles();
        let mut corners = joined.faces;
        let volume = volume(&triangles);
        if volume.abs() <= SAME * size.powi(3) * SAME {
            return Err("encloses no volume".into());
        }
        if volume < 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
            corners.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let mut normals = Vec::new();
        for (n, t) in triangles.iter().enumerate() {
            let across = cross(minus(t[1], t[0]), minus(t[2], t[0]));
            let longest = (0..3).map(|k| square(minus(t[(k + 1) % 3], t[k]))).fold(0.0, f64::max);
            let double = square(across).sqrt();
            if double <= 1e-9 * longest {
                return Err(format!(
                    "triangle {} at {} has no area: its corners lie on a line; repair the mesh, with whole triangles only",
                    n + 1,
                    place(t[0])
                ));
            }
            normals.push(across.map(|c| c / double));
        }
        let (of_edges, of_corners) = pseudo_normals(&triangles, &corners, &normals);
        let tree = Tree::new(&triangles);
        Ok(Self { triangles, low, high, volume: volume.abs(), normals, of_edges, of_corners, tree })
    }

    /// Multiplied by `scale`, then moved by `at`.
    ///
    /// # Errors
    /// As [`Solid::new`].
    pub fn placed(triangles: &[Triangle], scale: f64, at: [f64; 3]) -> Result<Self, String> {
        Self::new(triangles.iter().map(|t| t.map(|x| [0, 1, 2].map(|a| x[a] * scale + at[a]))).collect())
    }
}

impl Solid {
    /// The lines that bound it seen from above: edges between a triangle that faces upwards and one that does not.
    pub fn outline(&self) -> Vec<[[f64; 2]; 2]> {
        let bits = |x: [f64; 3]| x.map(|c| (c + 0.0).to_bits());
        let mut edges: HashMap<_, (usize, [[f64; 2]; 2])> = HashMap::new();
        for (t, normal) in self.triangles.iter().zip(&self.normals) {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let key = (bits(a).min(bits(b)), bits(a).max(bits(b)));
                let edge = edges.entry(key).or_insert((0, [[a[0], a[1]], [b[0], b[1]]]));
                edge.0 += usize::from(normal[2] > 1e-9);
            }
        }
        let mut lines: Vec<_> = edges.into_iter().filter(|(_, (up, _))| *up == 1).collect();
        lines.sort_unstable_by_key(|(key, _)| *key);
        lines.into_iter().map(|(_, (_, line))| line).collect()
    }
}

impl Solid {
    /// The parts that share no corner, each a solid of its own: they may overlap. With hollows, which are parts that are turned
    /// inwards, all of it.
    pub fn parts(&self) -> Vec<Self> {
        // Of each corner the number of its part, or of a part that has been joined to another one.
        let mut parts: HashMap<[u64; 3], usize> = HashMap::new();
        let mut joined: Vec<usize> = Vec::new();
        let top = |joined: &[usize], mut part: usize| {
            while joined[part] != part {
                part = joined[part];
            }
            part
        };
        let key = |x: [f64; 3]| x.map(|c| (c + 0.0).to_bits());
        for t in &self.triangles {
            let known: Vec<usize> = t.iter().filter_map(|x| parts.get(&key(*x))).map(|p| top(&joined, *p)).collect();
            let part = known.iter().copied().min().unwrap_or(joined.len());
            if part == joined.len() {
                joined.push(part);
            }
            known.into_iter().for_each(|other| joined[other] = part);
            t.iter().for_each(|x| {
                parts.insert(key(*x), part);
            });
        }
        let mut found: BTreeMap<usize, Vec<Triangle>> = BTreeMap::new();
        for t in &self.triangles {
            found.entry(top(&joined, parts[&key(t[0])])).or_default().push(*t);
        }
        let outwards = |triangles: &Vec<Triangle>| volume(triangles) > 0.0;
        let solids: Option<Vec<Self>> = match found.len() > 1 && found.values().all(outwards) {
            true => found.into_values().map(|triangles| Self::new(triangles).ok()).collect(),
            false => None,
        };
        solids.unwrap_or_else(|| vec![self.clone()])
    }
}

fn volume(triangles: &[Triangle]) -> f64 {
    triangles.iter().map(|t| dot(t[0], cross(t[1], t[2])) / 6.0).sum()
}

/// Corners by number.
struct Joined {
    corners: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl Joined {
    /// Corners within `near` of one that came before are that one. Triangles that have lost an edge by that are left out: the
    /// two others lie on each other.
    fn of(triangles: &[Triangle], near: f64) -> Self {
        let mut corners: Vec<[f64; 3]> = Vec::new();
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        // Without a tolerance a cell is a number: minus zero is zero.
        let cell = |x: f64| if near > 0.0 { (x / near).floor() as i64 } else { (x + 0.0).to_bits() as i64 };
        let around = if near > 0.0 { -1..=1 } else { 0..=0 };
        let mut number = |x: [f64; 3]| {
            let home = x.map(cell);
            for i in around.clone() {
                for j in around.clone() {
                    for k in around.clone() {
                        let there = cells.get(&[home[0] + i, home[1] + j, home[2] + k]);
                        let same = |n: &&u32| square(minus(corners[**n as usize], x)) <= near * near;
                        if let Some(&found) = there.and_then(|there| there.iter().find(same)) {
                            return found;
                        }
                    }
                }
            }
            cells.entry(home).or_default().push(corners.len() as u32);
            corners.push(x);
            corners.len() as u32 - 1
        };
        let faces = triangles.iter().map(|t| t.map(&mut number));
        let faces = faces.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        Self { corners, faces }
    }

    fn triangles(&self) -> Vec<Triangle> {
        self.faces.iter().map(|face| face.map(|n| self.corners[n as usize])).collect()
    }

    /// Each edge must be gone along once in each direction. Several pairs may share an edge, as where two solids touch.
    fn fault(&self) -> Option<String> {
        let mut edges: HashMap<[u32; 2], [u32; 2]> = HashMap::new();
        for face in &self.faces {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                edges.entry([a.min(b), a.max(b)]).or_default()[usize::from(a > b)] += 1;
            }
        }
        if self.faces.is_empty() {
            return Some("all its triangles have shrunk to lines".into());
        }
        let mut wrong: Vec<_> = edges.into_iter().filter(|(_, [there, back])| there != back).collect();
        wrong.sort_unstable();
        let (&([a, b], ways), many) = (wrong.first()?, wrong.len());
        let open = wrong.iter().filter(|(_, [there, back])| there + back == 1).count();
        let edge = format!("{} to {}", place(self.corners[a as usize]), place(self.corners[b as usize]));
        Some(if open > 0 {
            format!(
                "its surface is not closed: {open} edges have a triangle on one side only, the first one from {edge}; close \
                 the holes, so that each edge is shared by two triangles"
            )
        } else if ways[0] + ways[1] == 2 {
            format!(
                "its triangles are not turned alike: at {many} edges, the first one from {edge}, one faces outwards and the \
                 other inwards; turn all of them outwards"
            )
        } else {
            format!(
                "its surface is not that of a solid: {} triangles meet at the edge from {edge}, and {} more are like it; each \
                 edge must be shared by two",
                ways[0] + ways[1],
                many - 1
            )
        })
    }
}

/// Normals of edges and corners (Baerentzen & Aanaes 2005): the sums of those of the triangles there, at corners weighed with
/// their angles. A point is outside where it lies on their side of the nearest point of the surface.
fn pseudo_normals(
    triangles: &[Triangle],
    faces: &[[u32; 3]],
    normals: &[[f64; 3]],
) -> (Vec<[[f64; 3]; 3]>, Vec<[[f64; 3]; 3]>) {
    let mut edges: HashMap<[u32; 2], [f64; 3]> = HashMap::new();
    let mut corners: HashMap<u32, [f64; 3]> = HashMap::new();
    let key = |face: &[u32; 3], k: usize| {
        let (a, b) = (face[k], face[(k + 1) % 3]);
        [a.min(b), a.max(b)]
    };
    for ((face, t), n) in faces.iter().zip(triangles).zip(normals) {
        for k in 0..3 {
            let (u, v) = (minus(t[(k + 1) % 3], t[k]), minus(t[(k + 2) % 3], t[k]));
            let angle = square(cross(u, v)).sqrt().atan2(dot(u, v));
            let at_edge = edges.entry(key(face, k)).or_default();
            *at_edge = [0, 1, 2].map(|a| at_edge[a] + n[a]);
            let at_corner = corners.entry(face[k]).or_default();
            *at_corner = [0, 1, 2].map(|a| at_corner[a] + angle * n[a]);
        }
    }
    let of_edges = faces.iter().map(|face| [0, 1, 2].map(|k| edges[&key(face, k)])).collect();
    let of_corners = faces.iter().map(|face| face.map(|n| corners[&n])).collect();
    (of_edges, of_corners)
}

fn bounds(triangles: &[Triangle]) -> ([f64; 3], [f64; 3]) {
    let all = || triangles.iter().flatten();
    let low = [0, 1, 2].map(|a| all().map(|x| x[a]).fold(f64::INFINITY, f64::min));
    (low, [0, 1, 2].map(|a| all().map(|x| x[a]).fold(f64::NEG_INFINITY, f64::max)))
}

fn place(x: [f64; 3]) -> String {
    format!("({}, {}, {})", x[0], x[1], x[2])
}

pub(super) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn square(a: [f64; 3]) -> f64 {
    dot(a, a)
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stl::tests::block;

    fn told(triangles: Vec<Triangle>) -> String {
        Solid::new(triangles).unwrap_err()
    }

    #[test]
    fn a_box_is_a_solid_whichever_way_it_is_turned() {
        let triangles = block([1.0, 2.0, -1.0], [3.0, 5.0, 0.5]);
        let solid = Solid::new(triangles.clone()).unwrap();
        assert_eq!((solid.low, solid.high), ([1.0, 2.0, -1.0], [3.0, 5.0, 0.5]));
        assert!((solid.volume - 9.0).abs() < 1e-12);
        let inside_out = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let turned = Solid::new(inside_out).unwrap();
        assert_eq!(turned.volume, solid.volume);
        assert_eq!(turned.normals, solid.normals);
        assert_eq!(solid.normals[0], [-1.0, 0.0, 0.0]);
        let outline = solid.outline();
        let length = |[a, b]: &[[f64; 2]; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        assert_eq!(outline.len(), 4);
        assert!((outline.iter().map(length).sum::<f64>() - 10.0).abs() < 1e-12);
        let placed = Solid::placed(&triangles, 0.5, [10.0, 0.0, 0.0]).unwrap();
        assert_eq!((placed.low, placed.high), ([10.5, 1.0, -0.5], [11.5, 2.5, 0.25]));
    }

    #[test]
    fn parts_are_solids_unless_one_is_a_hollow() {
        let two = [block([0.0; 3], [2.0; 3]), block([1.0; 3], [3.0; 3])].concat();
        let parts = Solid::new(two).unwrap().parts();
        assert_eq!(parts.len(), 2);
        // Inside the first, and nearest to the surface of the second: there the whole seems to have a hole.
        let x = [0.95, 1.5, 1.5];
        assert!(parts[0].contains(x) && !parts[1].contains(x));
        let inwards = block([0.5; 3], [1.5; 3]).into_iter().map(|[a, b, c]| [a, c, b]).collect();
        let hollow = Solid::new([block([0.0; 3], [2.0; 3]), inwards].concat()).unwrap();
        assert_eq!(hollow.parts().len(), 1);
        assert!(!hollow.contains([1.0; 3]) && hollow.contains([0.25, 1.0, 1.0]));
        assert!((hollow.volume - 7.0).abs() < 1e-12);
    }

    #[test]
    fn corners_that_nearly_meet_are_joined_and_slivers_dropped() {
        let mut triangles = block([0.0; 3], [1.0; 3]);
        triangles[3][1][2] += 3e-7;
        triangles.push([[0.0; 3], [0.0; 3], [1.0; 3]]);
        let solid = Solid::new(triangles).unwrap();
        assert_eq!(solid.triangles.len(), 12);
        assert!((solid.volume - 1.0).abs() < 1e-6);
    }

    #[test]
    fn holes_and_other_faults_are_told_with_their_places() {
        let whole = block([0.0; 3], [1.0; 3]);
        let hole = told(whole[1..].to_vec());
        assert!(hole.contains("not closed: 3 edges") && hole.contains("(0, 0, 0) to (0, 1, 1)"), "{hole}");
        let mut turned = whole.clone();
        turned[5].swap(0, 1);
        assert!(told(turned).contains("not turned alike: at 3 edges"));
        let mut fin = whole.clone();
        fin.extend([[[0.0; 3], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]], [[0.0; 3], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]);
        assert!(Solid::new(fin).is_ok(), "a fin of two sides encloses nothing, but has no edge");
        // A corner on an edge makes a triangle on a line.
        let mut line = whole.clone();
        let [a, b, c] = line[0];
        let m = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
        line[0] = [m, b, c];
        line.extend([[a, m, c], [a, b, m]]);
        assert!(told(line).contains("triangle 14 at (0, 0, 0) has no area"));
        assert!(told(vec![[[0.0; 3], [1.0; 3], [1.0; 3]]]).contains("shrunk to lines"));
    }
}
