//! Particles of one snapshot, thinned for a picture.

use crate::{field::Field, geometry::Geometry, layers::Layers, section::plane};
use formats::{snapshot::Rows, space::Space};
use std::collections::BTreeMap;

/// Most squares in one panel: what keeps an SVG small enough for a browser.
const MOST: usize = 4000;

/// A square: a particle, or several in one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// Centre: x or r, and z, m.
    pub at: [f64; 2],
    /// Mean speed, m/s.
    pub speed: f64,
    /// The horizontal and the vertical layer most of its particles began in, where that is known.
    pub layers: Option<[u8; 2]>,
    /// Does it hold strays only?
    pub stray: bool,
}

/// Squares to draw in a vertical section.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Side of a square, m.
    pub size: f64,
    /// What to draw.
    pub squares: Vec<Square>,
    /// Means of the wanted fields over the particles of each square, field by field.
    pub fields: Vec<Vec<f64>>,
}

impl Scatter {
    /// All particles in the plane spaces; in 3-D those less than a spacing from the [`plane`] of the section. Too many are joined
    /// in square cells. Particles beyond `front`, along the profile, are strays.
    pub fn new(g: &Geometry, rows: &Rows, layers: Option<&Layers>, front: f64, fields: &[&Field]) -> Self {
        let section = plane(g, rows);
        let near = |row: &usize| g.space != Space::ThreeD || (rows.position[*row][1] - section).abs() < g.dx;
        let chosen: Vec<usize> = (0..rows.len()).filter(near).collect();
        let square = |row: usize| Square {
            at: [rows.position[row][0], rows.position[row][2]],
            speed: rows.velocity[row].iter().map(|v| v * v).sum::<f64>().sqrt(),
            layers: layers.map(|l| [l.horizontal[row], l.vertical[row]]),
            stray: g.along(rows.position[row]) > front,
        };
        let mut size = g.dx;
        let mut squares: Vec<(Square, Vec<usize>)> = chosen.iter().map(|&row| (square(row), vec![row])).collect();
        while squares.len() > MOST {
            size *= 1.25;
            let mut cells: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
            for &row in &chosen {
                let x = rows.position[row];
                cells.entry([x[0], x[2]].map(|x| (x / size).floor() as i64)).or_default().push(row);
            }
            let centre = |k: i64| (k as f64 + 0.5) * size;
            let several = |(k, all): ([i64; 2], Vec<usize>)| {
                let parts: Vec<Square> = all.iter().map(|&row| square(row)).collect();
                (joined(k.map(centre), &parts), all)
            };
            squares = cells.into_iter().map(several).collect();
        }
        let mean = |field: &Field, all: &[usize]| {
            all.iter().map(|&row| (field.value)(rows, row)).sum::<f64>() / all.len() as f64
        };
        let fields = fields.iter().map(|field| squares.iter().map(|(_, all)| mean(field, all)).collect()).collect();
        Self { size, squares: squares.into_iter().map(|s| s.0).collect(), fields }
    }
}

/// One square for several.
fn joined(at: [f64; 2], all: &[Square]) -> Square {
    let most_frequent = |which: usize| {
        let mut seen = [0_u32; 256];
        all.iter().filter_map(|q| q.layers).for_each(|l| seen[usize::from(l[which])] += 1);
        (0..=u8::MAX).max_by_key(|&n| (seen[usize::from(n)], u8::MAX - n)).unwrap_or(0)
    };
    Square {
        at,
        speed: all.iter().map(|q| q.speed).sum::<f64>() / all.len() as f64,
        layers: all[0].layers.map(|_| [most_frequent(0), most_frequent(1)]),
        stray: all.iter().all(|q| q.stray),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        field,
        testing::{block, geometry},
    };
    use formats::kernel::Kernel;

    #[test]
    fn few_particles_stay_and_many_are_joined() {
        let g = geometry(Space::PlaneStrain, Kernel::CubicSpline, 0.01);
        let mut rows = block(&g, [20, 1, 20]);
        rows.velocity.fill([3.0, 0.0, 4.0]);
        let s = Scatter::new(&g, &rows, None, f64::INFINITY, &[]);
        assert_eq!((s.squares.len(), s.size), (400, 0.01));
        let mut rows = block(&g, [100, 1, 100]);
        rows.velocity.fill([3.0, 0.0, 4.0]);
        let layers = Layers::new(&g, &rows.position, 5);
        let s = Scatter::new(&g, &rows, Some(&layers), 0.9, &[field::parse("velocity_z").unwrap()]);
        assert!(s.squares.len() <= MOST && s.squares.len() > MOST / 3, "{}", s.squares.len());
        assert!(s.squares.iter().all(|q| (q.speed - 5.0).abs() < 1e-12));
        assert!(s.fields[0].len() == s.squares.len() && s.fields[0].iter().all(|v| (v - 4.0).abs() < 1e-12));
        // Layers are 0.2 m thick; a square that lies across two has one of them.
        let near = |n: u8, v: f64| (f64::from(n) * 0.2 - s.size..=(f64::from(n) + 1.0) * 0.2 + s.size).contains(&v);
        assert!(s.squares.iter().all(|q| q.layers.is_some_and(|l| near(l[0], q.at[1]) && near(l[1], q.at[0]))));
        assert!(s.squares.iter().all(|q| if q.stray { q.at[0] > 0.9 } else { q.at[0] < 0.9 + s.size }));
    }

    #[test]
    fn a_section_is_taken_in_space() {
        let g = geometry(Space::ThreeD, Kernel::CubicSpline, 0.01);
        let rows = block(&g, [5, 5, 5]);
        assert_eq!(Scatter::new(&g, &rows, None, f64::INFINITY, &[]).squares.len(), 25);
    }
}
