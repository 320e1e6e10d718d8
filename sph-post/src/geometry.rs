//! What the evaluation needs to know of the scene: the floor, the axis, the sizes everything is scaled with.

use formats::{
    kernel::Kernel,
    laws,
    scene::{Body, Material, Scene, Shape},
    space::Space,
};
use std::f64::consts::PI;

/// The scene, as the evaluation sees it.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// Space.
    pub space: Space,
    /// Kernel.
    pub kernel: Kernel,
    /// Lattice spacing dx, m: also the width of all bins.
    pub dx: f64,
    /// Smoothing length h, m.
    pub h: f64,
    /// Gravity, m/s2.
    pub gravity: [f64; 3],
    /// Height of the floor, m; 0 over a terrain, where heights are those above the ground.
    pub floor: f64,
    /// Height from which potential energies are measured, m.
    pub datum: f64,
    /// Are x = 0 and y = 0 planes (or, axisymmetric, x = 0 the axis) at which particles are mirrored?
    pub mirrored: [bool; 2],
    /// Where a wall across x bounds the material on its lower and its upper side, m; infinite where none does.
    pub walls: [f64; 2],
    /// Are profiles taken along the radius (else along x)?
    pub radial: bool,
    /// Width of the material across the profile, m: 1 in plane strain, the y extent in 3-D; not for radial profiles.
    pub width: f64,
    /// Density at the start, kg/m3.
    pub density: f64,
    /// What the bodies are made of.
    pub material: Material,
    /// The one body's extent along the profile: where it begins and ends, m. `None` with several bodies.
    pub extent: Option<[f64; 2]>,
    /// Can the one body spread only outward: from the axis, or along +x from the plane of symmetry or the wall it starts
    /// at? Else its fronts don't say how far it ran.
    pub runs_outward: bool,
    /// Height of the highest body above the floor at the start, m.
    pub height: f64,
    /// Aspect ratio of a cylinder on the axis that starts at rest as the only body: for comparison with Lube et al.
    pub cylinder_aspect: Option<f64>,
    /// Height over length of a rectangle that starts at rest as the only body and can spread to one side only, in plane
    /// strain: for comparison with Lube et al. (2005).
    pub plane_aspect: Option<f64>,
}

/// What a published law says of the final deposit of a column, over its initial extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// (front - r0)/r0.
    pub run_out: Option<f64>,
    /// Height in the centre.
    pub height: Option<f64>,
    /// Whose law it is.
    pub source: &'static str,
}

impl Geometry {
    /// From the scene.
    pub fn new(scene: &Scene) -> Self {
        let (dx, floor, radial) = (scene.spacing, floor(scene), scene.is_radial());
        let mirrored = if scene.space == Space::Axisymmetric { [true, false] } else { scene.symmetry };
        let walls = [(1.0, f64::NEG_INFINITY), (-1.0, f64::INFINITY)]
            .map(|(side, none)| scene.walls.iter().find(|w| w.axis == 0 && w.side == side).map_or(none, |w| w.at));
        let single = if let [body] = &scene.bodies[..] { Some(body) } else { None };
        let extent = single.map(|b| extent(b, scene.space, radial || mirrored[0]));
        let top = scene.bodies.iter().map(|b| top(b, scene)).fold(f64::NEG_INFINITY, f64::max);
        let runs_outward = single.zip(extent).is_some_and(|(body, [begin, _])| {
            let left = if radial || mirrored[0] { 0.0 } else { walls[0] };
            (begin - left).abs() <= 0.5 * dx && runs_right(body, radial)
        });
        Self {
            space: scene.space,
            kernel: scene.kernel,
            dx,
            h: scene.h(),
            gravity: scene.gravity,
            floor,
            datum: scene.floor(),
            mirrored,
            walls,
            radial,
            width: width(scene),
            material: scene.material.clone(),
            density: scene.material.density(),
            extent,
            runs_outward,
            height: (top - floor).max(0.0),
            cylinder_aspect: single.and_then(|b| match b.shape {
                Shape::Cylinder { radius, height, .. } if b.is_cylinder_on_axis() && b.velocity == [0.0; 3] => {
                    Some(height / radius)
                }
                _ => None,
            }),
            plane_aspect: single.zip(extent).and_then(|(body, [begin, end])| {
                let falls = scene.gravity[0] == 0.0 && scene.gravity[2] < 0.0 && walls[1].is_infinite();
                let (low, high) = body.shape.bounds(scene.space);
                let stands = body.velocity == [0.0; 3] && (low[2] - floor).abs() <= 0.5 * dx;
                let is_box = scene.space == Space::PlaneStrain && matches!(body.shape, Shape::Box { .. });
                (is_box && runs_outward && falls && stands).then(|| (high[2] - low[2]) / (end - begin))
            }),
        }
    }

    /// The law for columns like this, if there is one.
    pub fn law(&self) -> Option<Law> {
        let round = self.cylinder_aspect.map(|a| Law {
            run_out: Some(laws::lube_runout(a)),
            height: laws::lube_height(a),
            source: "Lube et al. (2004)",
        });
        round.or_else(|| {
            self.plane_aspect.map(|a| Law {
                run_out: laws::lube_plane_runout(a),
                height: laws::lube_plane_height(a),
                source: "Lube et al. (2005)",
            })
        })
    }

    /// Where a point lies along the profile, m.
    pub fn along(&self, x: [f64; 3]) -> f64 {
        if self.radial { x[0].hypot(x[1]) } else { x[0] }
    }

    /// Volume of a particle in the sense of the kernel: what sum of V W needs to be one. m2 in the plane spaces.
    pub fn kernel_volume(&self, x: [f64; 3], volume: f64) -> f64 {
        match self.space {
            // On the axis itself the area of a ring says nothing.
            Space::Axisymmetric => volume / (2.0 * PI * x[0].max(0.5 * self.dx)),
            _ => volume,
        }
    }

    /// Area of the floor under bin `k`, the one between k dx and (k+1) dx, m2: of the modelled part only. Per metre of
    /// depth in plane strain.
    pub fn bin_area(&self, k: i64) -> f64 {
        let k = k as f64;
        if self.radial {
            let whole = PI * ((k + 1.0).powi(2) - k * k) * self.dx * self.dx;
            if self.space == Space::ThreeD { whole * self.modelled() } else { whole }
        } else {
            self.width * self.dx
        }
    }

    /// Share of the whole that is modelled: 1/2 for each plane of symmetry.
    pub fn modelled(&self) -> f64 {
        match self.space {
            Space::Axisymmetric => 1.0,
            _ => self.mirrored.iter().map(|&m| if m { 0.5 } else { 1.0 }).product(),
        }
    }

    /// Initial extent r0 of the single body along the profile, m.
    pub fn r0(&self) -> Option<f64> {
        self.extent.map(|[begin, end]| end - begin)
    }

    /// Time scale sqrt(H0/g), s.
    pub fn time_scale(&self) -> Option<f64> {
        let g = self.gravity[2].abs();
        (g > 0.0 && self.height > 0.0).then(|| (self.height / g).sqrt())
    }

    /// Name of the coordinate along profiles: `r` or `x`.
    pub fn coordinate(&self) -> &'static str {
        if self.radial { "r" } else { "x" }
    }
}

fn floor(scene: &Scene) -> f64 {
    if scene.terrain.is_some() { 0.0 } else { scene.floor() }
}

/// The highest point of a body; over a terrain its height.
fn top(body: &Body, scene: &Scene) -> f64 {
    let (low, high) = body.shape.bounds(scene.space);
    match &body.shape {
        Shape::Release(release) => release.thickest(),
        _ if scene.terrain.is_some() => high[2] - low[2],
        _ => high[2],
    }
}

/// Where a body begins and ends along the profile; `cut` at the axis or the plane of symmetry.
fn extent(body: &Body, space: Space, cut: bool) -> [f64; 2] {
    let (low, high) = body.shape.bounds(space);
    [if cut { low[0].max(0.0) } else { low[0] }, high[0]]
}

/// Does a body whose left side is held run out to the right? A wedge that falls to the left runs the other way, and a
/// cylinder only touches what it leans on: it runs around.
fn runs_right(body: &Body, radial: bool) -> bool {
    match body.shape {
        Shape::Cylinder { .. } => radial,
        // Down the slope, wherever that is.
        Shape::Release(_) => false,
        Shape::Box { .. } => true,
        Shape::Wedge { falls_left, .. } => !falls_left,
    }
}

/// Extent of the material along y: between two walls, or that of the bodies.
fn width(scene: &Scene) -> f64 {
    if scene.space != Space::ThreeD {
        return 1.0;
    }
    let boxes = || scene.bodies.iter().map(|b| b.shape.bounds(scene.space));
    let mut low = boxes().map(|b| b.0[1]).fold(f64::INFINITY, f64::min);
    let mut high = boxes().map(|b| b.1[1]).fold(f64::NEG_INFINITY, f64::max);
    for wall in scene.walls.iter().filter(|w| w.axis == 1) {
        if wall.side > 0.0 { low = wall.at } else { high = wall.at }
    }
    if scene.symmetry[1] {
        low = low.max(0.0);
    }
    (high - low).max(scene.spacing)
}
