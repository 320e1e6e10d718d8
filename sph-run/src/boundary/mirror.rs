//! Mirror images behind planes of symmetry, the axis of the axisymmetric space, and mirror walls (ghost particles,
//! Szewc 2017): of every particle near a plane, in corners also through several planes one after the other.

use crate::algebra::Vector;
use crate::boundary::field::{Field, Reflection, Spread};
use crate::parallel::halo::Fields;
use crate::particles::{IMAGE_BITS_PER_AXIS, Particles, id, key};
use crate::space::Space;
use formats::scene::{Scene, Slip, Wall, WallKind};
use formats::space::Space as Kind;

/// The mirrors of a scene, and the images that one rank has.
#[derive(Clone, Debug)]
pub struct Mirrors<const D: usize, const N: usize> {
    planes: Vec<Plane<D, N>>,
    /// Along each coordinate, the ways to get behind a plane; the first is to stay.
    ways: Vec<Vec<Way<D, N>>>,
    /// Each choice of one way a coordinate but that of staying along all, in ascending code.
    routes: Vec<Route<D, N>>,
    images: Vec<Image>,
}

/// A mirror.
#[derive(Clone, Copy, Debug)]
struct Plane<const D: usize, const N: usize> {
    wall: Wall,
    /// Index of its axis among the coordinates.
    axis: usize,
    reflection: Reflection<D, N>,
}

impl<const D: usize, const N: usize> Plane<D, N> {
    /// How far behind the plane a point is, m.
    fn depth(&self, x: Vector<D>) -> f64 {
        self.wall.side * (self.wall.at - x.0[self.axis])
    }
}

/// Reflections along one axis: through a plane, or through the one that faces it before.
#[derive(Clone, Copy, Debug)]
struct Way<const D: usize, const N: usize> {
    code: u16,
    reflection: Reflection<D, N>,
    /// The plane the image lies behind.
    behind: Option<Plane<D, N>>,
}

/// One way along each coordinate.
#[derive(Clone, Copy, Debug)]
struct Route<const D: usize, const N: usize> {
    code: u16,
    ways: [usize; D],
    reflection: Reflection<D, N>,
}

/// One image: which particle, by which route.
#[derive(Clone, Copy, Debug)]
struct Image {
    source: u32,
    route: u32,
}

impl<const D: usize, const N: usize> Mirrors<D, N> {
    /// Those of a scene.
    pub fn new<S: Space<D, N>>(scene: &Scene) -> Self {
        let symmetric = [scene.symmetry[0] || scene.space == Kind::Axisymmetric, scene.symmetry[1]];
        let of_symmetry = (0..2).filter(|&axis| symmetric[axis]).map(|axis| Wall {
            axis,
            at: 0.0,
            side: 1.0,
            slip: Slip::FreeSlip,
            kind: WallKind::Mirror,
            velocity: [0.0; 3],
        });
        let of_walls = scene.walls.iter().copied().filter(|wall| wall.kind == WallKind::Mirror);
        let planes: Vec<Plane<D, N>> = of_symmetry
            .chain(of_walls)
            .filter_map(|wall| {
                let axis = S::axis(wall.axis)?;
                Some(Plane { wall, axis, reflection: reflection::<D, N, S>(&wall, axis) })
            })
            .collect();
        let mut ways: Vec<Vec<Way<D, N>>> = Vec::new();
        for axis in 0..D {
            let mut along = vec![Way { code: 0, reflection: Reflection::IDENTITY, behind: None }];
            let on_side = |side: f64| planes.iter().find(|plane| plane.axis == axis && plane.wall.side == side);
            let (low, high) = (on_side(1.0), on_side(-1.0));
            // An image of an image is in reach only where the planes are less than the reach apart; where they are at least
            // half of it, as a checked scene has them, no further image is.
            for (code, first, last) in [(1, None, low), (2, None, high), (3, high, low), (4, low, high)] {
                let Some(last) = last else { continue };
                let reflection = match first {
                    None if code > 2 => continue,
                    None => last.reflection,
                    Some(plane) => plane.reflection.then(&last.reflection),
                };
                let code = code << (IMAGE_BITS_PER_AXIS * last.wall.axis as u32);
                along.push(Way { code, reflection, behind: Some(*last) });
            }
            ways.push(along);
        }
        let mut routes = vec![Route { code: 0, ways: [0; D], reflection: Reflection::IDENTITY }];
        for (axis, along) in ways.iter().enumerate() {
            for route in routes.clone() {
                for (k, way) in along.iter().enumerate().skip(1) {
                    let mut longer = route;
                    longer.code |= way.code;
                    longer.ways[axis] = k;
                    longer.reflection = route.reflection.then(&way.reflection);
                    routes.push(longer);
                }
            }
        }
        routes.sort_by_key(|route| route.code);
        routes.remove(0);
        Self { planes, ways, routes, images: Vec::new() }
    }

    /// Is a place within `reach` of a plane?
    pub fn are_near(&self, x: Vector<D>, reach: f64) -> bool {
        self.planes.iter().any(|plane| plane.depth(plane.reflection.place(x)) < reach)
    }

    /// Appends the images of owned and halo particles that lie within `reach(x)` of a plane. Their fields are not filled.
    pub fn create(&mut self, particles: &mut Particles<D, N>, reach: impl Fn(Vector<D>) -> f64) {
        debug_assert_eq!(particles.halo, particles.len());
        self.images.clear();
        for i in (0..particles.halo).filter(|_| !self.planes.is_empty()) {
            let x = particles.x[i];
            let reach = reach(x);
            let close = |way: &Way<D, N>| way.behind.is_none_or(|plane| plane.depth(way.reflection.place(x)) < reach);
            let near: [[bool; 5]; D] =
                std::array::from_fn(|a| std::array::from_fn(|k| self.ways[a].get(k).is_some_and(close)));
            if near.iter().all(|along| !along[1..].contains(&true)) {
                continue;
            }
            for (number, route) in self.routes.iter().enumerate() {
                if (0..D).all(|a| near[a][route.ways[a]]) {
                    self.images.push(Image { source: i as u32, route: number as u32 });
                    particles.key.push(key(id(particles.key[i]), route.code));
                }
            }
        }
        let len = particles.key.len();
        particles.resize(len);
        particles.mirror = len;
    }

    /// Refreshes fields of the images.
    pub fn fill(&self, p: &mut Particles<D, N>, fields: Fields) {
        let first = p.halo;
        fields.visit(p, |field| match field {
            Field::Scalar(field) => self.each(field, first, |_, scalar| scalar),
            Field::Place(field) => self.each(field, first, Reflection::place),
            Field::Velocity(field) => self.each(field, first, Reflection::velocity),
            Field::Stress(field) => self.each(field, first, Reflection::stress),
        });
    }

    fn each<T: Copy>(&self, field: &mut [T], first: usize, of: impl Fn(&Reflection<D, N>, T) -> T) {
        for (k, image) in self.images.iter().enumerate() {
            field[first + k] = of(&self.routes[image.route as usize].reflection, field[image.source as usize]);
        }
    }

    /// Gives a field that owned particles and their copies have to their images too, and zero to wall particles.
    pub fn spread<T: Spread<D, N>>(&self, p: &Particles<D, N>, field: &mut Vec<T>) {
        field.truncate(p.halo);
        for image in &self.images {
            field.push(field[image.source as usize].reflected(&self.routes[image.route as usize].reflection));
        }
        field.resize(p.len(), T::zero());
    }

    /// Puts an owned particle that crossed a plane back, as its own image.
    pub fn keep_inside(&self, p: &mut Particles<D, N>) {
        for plane in &self.planes {
            for i in 0..p.owned {
                if plane.depth(p.x[i]) > 0.0 {
                    p.x[i] = plane.reflection.place(p.x[i]);
                    p.v[i] = plane.reflection.velocity(p.v[i]);
                    p.stress[i] = plane.reflection.stress(p.stress[i]);
                }
            }
        }
    }
}

fn reflection<const D: usize, const N: usize, S: Space<D, N>>(wall: &Wall, axis: usize) -> Reflection<D, N> {
    match wall.slip {
        Slip::FreeSlip => {
            let shears = reflect_stress([1.0; 6], [0, 1, 2].map(|a| a == wall.axis));
            Reflection::slip(axis, wall.at, S::stress_from_disk(shears))
        }
        Slip::NoSlip => Reflection::stick(axis, wall.at, S::from_disk(wall.velocity)),
    }
}

/// M sigma M for a reflection M of some axes: exactly the shears with one reflected index change sign.
pub fn reflect_stress(mut s: [f64; 6], through: [bool; 3]) -> [f64; 6] {
    for (component, (a, b)) in [(3, (0, 1)), (4, (1, 2)), (5, (0, 2))] {
        if through[a] != through[b] {
            s[component] = -s[component];
        }
    }
    s
}
