//! Lists of the neighbours of each owned particle, and of the material each wall particle sees.
//!
//! A list holds every particle that can come within the support before the next build, in ascending key. Longer lists
//! than needed do no harm: the sweeps skip what is outside the support, so sums do not depend on when lists are built.

use crate::algebra::Vector;
use crate::particles::Particles;
use crate::physics::Kernel;
use crate::sweep::Support;

/// Lists of indices, one after the other.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    starts: Vec<u32>,
    indices: Vec<u32>,
}

impl Lists {
    /// The list of entry `i`.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.indices[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
    /// Number of lists.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }
    /// No lists?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Where the list of entry `i` starts among all indices.
    pub fn start(&self, i: usize) -> usize {
        self.starts[i] as usize
    }

    fn clear(&mut self) {
        self.starts.clear();
        self.starts.push(0);
        self.indices.clear();
    }
    fn close(&mut self) {
        self.starts.push(u32::try_from(self.indices.len()).expect("a rank holds fewer than 2^32 pairs"));
    }
}

/// Neighbour lists of one rank.
#[derive(Clone, Debug, Default)]
pub struct Neighbors {
    /// For each owned particle: particles of all ranges but itself.
    pub of_owned: Lists,
    /// For each wall particle: material particles of all ranges but the walls.
    pub of_wall: Lists,
    /// Of the lists of owned particles, what is within the support at this step.
    pub support: Support,
}

impl Neighbors {
    /// Finds what is within the support, 2h, at the present places.
    pub fn find<const D: usize, const N: usize, K: Kernel>(&mut self, particles: &Particles<D, N>, h: f64) {
        self.support.find::<D, N, K>(particles, &self.of_owned, h);
    }

    /// Lists of all pairs closer than `reach`.
    pub fn build<const D: usize, const N: usize>(&mut self, particles: &Particles<D, N>, reach: f64) {
        // Number the particles in ascending key. Cells hold these numbers, so that a list is sorted as plain integers.
        let mut by_key: Vec<u32> = (0..particles.len() as u32).collect();
        by_key.sort_unstable_by_key(|&i| particles.key[i as usize]);
        let cells = Cells::new(&particles.x, &by_key, reach);

        let mut found: Vec<u32> = Vec::new();
        let mut collect = |lists: &mut Lists, i: usize, limit: usize| {
            found.clear();
            let x = particles.x[i];
            cells.near(x, |number| {
                let j = by_key[number as usize] as usize;
                if j != i && j < limit && (x - particles.x[j]).norm2() < reach * reach {
                    found.push(number);
                }
            });
            found.sort(); // merges the runs of the cells
            lists.indices.extend(found.iter().map(|&number| by_key[number as usize]));
            lists.close();
        };
        self.of_owned.clear();
        for i in 0..particles.owned {
            collect(&mut self.of_owned, i, particles.len());
        }
        self.of_wall.clear();
        for i in particles.mirror..particles.len() {
            collect(&mut self.of_wall, i, particles.mirror);
        }
    }
}

/// A grid of cells at least `reach` wide. Its outermost cells reach to infinity.
struct Cells<const D: usize> {
    low: Vector<D>,
    width: f64,
    count: [usize; D],
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl<const D: usize> Cells<D> {
    fn new(x: &[Vector<D>], by_key: &[u32], reach: f64) -> Self {
        // A few particles far out must not make millions of empty cells: the grid covers where nearly all are, and its
        // outermost cells take in the rest. Should that not do, the cells are widened.
        let (low, high) = bulk(x);
        let mut width = reach;
        let shape = |width: f64| -> [usize; D] {
            std::array::from_fn(|a| (((high.0[a] - low.0[a]) / width).max(0.0) as usize).saturating_add(1))
        };
        while shape(width).iter().fold(1usize, |n, &c| n.saturating_mul(c)) > 4 * x.len() + 64 {
            width *= 2.0;
        }
        let count = shape(width);
        let mut cells =
            Self { low, width, count, starts: vec![0; count.iter().product::<usize>() + 1], members: vec![] };
        let cell: Vec<u32> = by_key.iter().map(|&i| cells.index(cells.coordinates(x[i as usize])) as u32).collect();
        for &c in &cell {
            cells.starts[c as usize + 1] += 1;
        }
        for c in 1..cells.starts.len() {
            cells.starts[c] += cells.starts[c - 1];
        }
        let mut next = cells.starts.clone();
        cells.members = vec![0; by_key.len()];
        for (number, &c) in cell.iter().enumerate() {
            cells.members[next[c as usize] as usize] = number as u32;
            next[c as usize] += 1;
        }
        cells
    }

    fn coordinates(&self, x: Vector<D>) -> [usize; D] {
        std::array::from_fn(|a| (((x.0[a] - self.low.0[a]) / self.width).max(0.0) as usize).min(self.count[a] - 1))
    }

    fn index(&self, c: [usize; D]) -> usize {
        (0..D).rev().fold(0, |index, a| index * self.count[a] + c[a])
    }

    /// Calls `visit` with every particle in the cell of `x` and the cells around it.
    fn near(&self, x: Vector<D>, mut visit: impl FnMut(u32)) {
        let c = self.coordinates(x);
        let mut low = c;
        let mut high = c;
        for a in 0..D {
            low[a] = c[a].saturating_sub(1);
            high[a] = (c[a] + 1).min(self.count[a] - 1);
        }
        let mut at = low;
        loop {
            // Cells that follow each other along the first axis are one run of members.
            let first = self.index(at);
            let last = first + high[0] - low[0];
            for &member in &self.members[self.starts[first] as usize..self.starts[last + 1] as usize] {
                visit(member);
            }
            let Some(axis) = (1..D).find(|&a| at[a] < high[a]) else { return };
            at[axis] += 1;
            at[1..axis].copy_from_slice(&low[1..axis]);
        }
    }
}

/// Lower and upper corner of a box that holds all but a thousandth of some points on each side of each axis.
fn bulk<const D: usize>(x: &[Vector<D>]) -> (Vector<D>, Vector<D>) {
    let few = x.len() / 1000;
    let (mut low, mut high) = bounds(x);
    if few > 0 {
        let mut along: Vec<f64> = Vec::with_capacity(x.len());
        for a in 0..D {
            along.clear();
            along.extend(x.iter().map(|p| p.0[a]));
            low.0[a] = *along.select_nth_unstable_by(few, f64::total_cmp).1;
            high.0[a] = *along.select_nth_unstable_by(x.len() - 1 - few, f64::total_cmp).1;
        }
    }
    (low, high)
}

/// Lower and upper corner of the box around some points; zeros where there are none.
pub fn bounds<const D: usize>(x: &[Vector<D>]) -> (Vector<D>, Vector<D>) {
    let Some(&first) = x.first() else { return (Vector::default(), Vector::default()) };
    x.iter().fold((first, first), |(low, high), p| {
        (Vector(std::array::from_fn(|a| low.0[a].min(p.0[a]))), Vector(std::array::from_fn(|a| high.0[a].max(p.0[a]))))
    })
}

/// The order of owned particles along rows of cells of the given width: close in memory what is close in space.
pub fn cell_order<const D: usize>(x: &[Vector<D>], width: f64) -> Vec<u32> {
    let (low, _) = bounds(x);
    let cell =
        |p: &Vector<D>| -> [u64; D] { std::array::from_fn(|a| ((p.0[D - 1 - a] - low.0[D - 1 - a]) / width) as u64) };
    let mut order: Vec<u32> = (0..x.len() as u32).collect();
    order.sort_by_cached_key(|&i| (cell(&x[i as usize]), i));
    order
}
