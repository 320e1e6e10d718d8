//! A checked scene: everything in SI units, every value within its range, every default filled in.
//!
//! [`Scene::read`] goes from text to a checked scene, or to the list of all its faults, each with line and column.

mod auto;
mod changes;
mod check;
mod error;
mod fit;
mod front;
mod geometry;
mod held;
mod initial;
mod law;
mod material;
mod numerics;
mod obstacle;
mod period;
mod periodic_axis;
mod raw;
mod release;
mod solids;
mod sources;
mod terrain;
mod walls;

pub use auto::{Choice, Chosen};
pub use changes::{Change, MAY_CHANGE};
pub use error::{Fault, SceneError};
pub use obstacle::Obstacle;
pub use periodic_axis::PeriodicAxis;
pub use release::{Depth, Release};
pub use solids::{Inside, Thin};
pub use sources::Sources;
pub use terrain::{Terrain, normal};
pub use walls::{FARTHEST, Parity, Site, WallLattice};

use crate::{kernel::Kernel, space::Space};

/// A checked scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// One line for titles of pictures and files.
    pub title: String,
    /// The space it is solved in.
    pub space: Space,
    /// Lattice spacing dx, m.
    pub spacing: f64,
    /// Acceleration of gravity, m/s2; y must be zero in the plane spaces, x and y in the axisymmetric one.
    pub gravity: [f64; 3],
    /// Is the plane x = 0, y = 0 a plane of symmetry? The material lies on the positive side.
    /// The axis of the axisymmetric space is implied: `[false; 2]` there.
    pub symmetry: [bool; 2],
    /// Where the scene repeats itself along x, y, z, m: lower and upper end. What leaves at one comes in at the other.
    pub periodic: [Option<[f64; 2]>; 3],
    /// Smoothing kernel.
    pub kernel: Kernel,
    /// Smoothing length over spacing, h/dx.
    pub h_over_dx: f64,
    /// What the bodies are made of.
    pub material: Material,
    /// At least one, none overlapping.
    pub bodies: Vec<Body>,
    /// Planes that hold the material.
    pub walls: Vec<Wall>,
    /// A floor of any height.
    pub terrain: Option<Terrain>,
    /// Fixed solid bodies, in the order of the file.
    pub obstacles: Vec<Obstacle>,
    /// Files that the scene names, in the order in which they are asked for, and the SHA-256 of what they hold.
    pub files: Vec<(String, String)>,
    /// Stress and disorder at the start.
    pub initial: Initial,
    /// Numerical parameters.
    pub numerics: Numerics,
    /// When the run is over.
    pub end: End,
    /// What is written while it runs.
    pub output: Output,
    /// What the program chose, where the text says `"auto"`; all else is the scene as it is run.
    pub chosen: Option<Chosen>,
}

/// Constitutive law.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// Elastic, perfectly plastic with the Drucker-Prager criterion.
    DruckerPrager(DruckerPrager),
    /// Granular fluid whose friction depends on the inertial number.
    MuI(MuI),
    /// Bingham fluid with a frictional yield stress.
    ViscoPlastic(ViscoPlastic),
}

/// Parameters of the Drucker-Prager law.
#[derive(Clone, Debug, PartialEq)]
pub struct DruckerPrager {
    /// Density at the start, kg/m3.
    pub density: f64,
    /// Young's modulus E, Pa.
    pub young: f64,
    /// Poisson's ratio, in [0, 0.5).
    pub poisson: f64,
    /// Friction angle, degrees, in [0, 90).
    pub friction_deg: f64,
    /// Dilation angle, degrees, in [0, friction].
    pub dilation_deg: f64,
    /// Cohesion, Pa.
    pub cohesion: f64,
    /// Which cone replaces the Mohr-Coulomb pyramid.
    pub cone: Cone,
    /// How the stress turns with the material.
    pub rotation: Rotation,
    /// Where the mean stress comes from.
    pub mean_stress: MeanStress,
}

/// Where the mean stress of the Drucker-Prager law comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeanStress {
    /// `rate`: it is integrated with the other components (Yang et al. 2020, Eq 15).
    Rate,
    /// `density`: it follows from the density, so that volume gained in free flight is given back. Without dilation only.
    Density,
}

/// Parameters of the mu(I) law (Jop, Forterre & Pouliquen 2006).
#[derive(Clone, Debug, PartialEq)]
pub struct MuI {
    /// Bulk density without pressure, kg/m3.
    pub density: f64,
    /// Speed of sound c of the equation of state p = c^2 (rho - rho0), m/s.
    pub sound_speed: f64,
    /// Friction coefficient mu_s at rest.
    pub friction_static: f64,
    /// Friction coefficient mu_2 of fast flow, at least `friction_static`.
    pub friction_dynamic: f64,
    /// Inertial number I0 half-way between the two.
    pub inertial_number: f64,
    /// Diameter d of the grains, m.
    pub grain_diameter: f64,
    /// Density rho_s of the grains, kg/m3.
    pub grain_density: f64,
    /// Norm of the shear rate.
    pub norm: Norm,
    /// Shape of mu(I).
    pub curve: Curve,
    /// What happens where the material does not flow.
    pub unyielded: Unyielded,
    /// Does a fluid below its initial density pull (negative pressure), or does it carry nothing?
    pub tension: bool,
}

/// Norm |gdot| of the shear rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Norm {
    /// `jop`: sqrt(2 e:e) (Jop et al. 2006).
    Jop,
    /// `printed`: sqrt(e:e), as in Yang et al. 2020, Eqs 5-7: sqrt(2) times the friction that is asked for.
    Printed,
}

/// Shape of mu(I).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// `jop`: mu_s + (mu_2 - mu_s)/(1 + I0/I).
    Jop,
    /// `partially-regularised`: well posed for all but very large I (Barker & Gray 2017).
    PartiallyRegularised,
}

/// The material below yield.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unyielded {
    /// `cap`: a fluid of finite viscosity; Pa s, or as large as the time step of sound allows.
    Cap(Option<f64>),
    /// `elastic`: a solid of this shear modulus, Pa (Dunatunga & Kamrin 2015).
    Elastic(f64),
}

/// Parameters of the visco-plastic fluid (Szewc 2017).
#[derive(Clone, Debug, PartialEq)]
pub struct ViscoPlastic {
    /// Density without pressure, kg/m3.
    pub density: f64,
    /// Speed of sound c of Tait's equation of state with exponent 7, m/s.
    pub sound_speed: f64,
    /// Friction angle, degrees, in [0, 90).
    pub friction_deg: f64,
    /// Cohesion, Pa.
    pub cohesion: f64,
    /// Viscosity mu_inf of fast flow, Pa s.
    pub viscosity: f64,
    /// Largest viscosity mu_solid, Pa s.
    pub viscosity_solid: f64,
    /// How viscous stress acts between particles.
    pub operator: ViscousOperator,
}

/// How viscous stress acts between particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViscousOperator {
    /// `arithmetic`: along pairs, with the sum of both viscosities (Szewc 2017, Eq 9).
    Arithmetic,
    /// `harmonic`: the same with twice the harmonic mean (Cleary & Monaghan 1999).
    Harmonic,
    /// `tensor`: as the stress 2 mu e, with the part of the velocity gradient the others leave out.
    Tensor,
}

/// Cones through different edges of the Mohr-Coulomb pyramid; the same angle means different strengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cone {
    /// `compression`: through the triaxial-compression corners (Yang et al. 2020, Eqs 12, 13).
    Compression,
    /// `extension`: through the triaxial-extension corners.
    Extension,
    /// `plane-strain`: exact in plane strain with associated flow (Bui et al. 2008).
    PlaneStrain,
    /// `plane-strain-isochoric`: exact in plane strain without dilation, alpha = sin(phi)/3.
    PlaneStrainIsochoric,
}

/// Integration of the rotation of stress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rotation {
    /// `jaumann`: forward Euler of the Jaumann rate (Yang et al. 2020, Eq 15).
    Jaumann,
    /// `hughes-winget`: incremental rotation that keeps the norm (Hughes & Winget 1980).
    HughesWinget,
}

/// A piece of material.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// For messages.
    pub name: String,
    /// Where it is.
    pub shape: Shape,
    /// Velocity at the start, m/s.
    pub velocity: [f64; 3],
}

/// Shapes of bodies, m.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Upright cylinder: `base` is the centre of its foot. In the axisymmetric space `base` lies on the axis.
    /// Not in plane strain.
    Cylinder {
        /// Centre of the foot.
        base: [f64; 3],
        /// Radius.
        radius: f64,
        /// Height.
        height: f64,
    },
    /// Box between two corners; in the plane spaces the y extent is ignored and zero.
    Box {
        /// Lower corner.
        min: [f64; 3],
        /// Upper corner.
        max: [f64; 3],
    },
    /// Prism along y whose x-z section is a right-angled triangle: vertical face of `size[2]` at `corner`,
    /// falling to nothing at `corner.x + size[0]` (or to the left where `falls_left`). Plane strain and 3-D.
    Wedge {
        /// Foot of the vertical face, lowest y.
        corner: [f64; 3],
        /// Length along x, width along y (ignored in the plane space), height along z.
        size: [f64; 3],
        /// Does the slope fall towards smaller x?
        falls_left: bool,
    },
    /// What lies on the terrain.
    Release(Release),
}

/// A plane wall normal to an axis, infinite in its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// The axis it is normal to: 0 x, 1 y, 2 z.
    pub axis: usize,
    /// Its place on that axis, m. A whole number of spacings from 0 where a symmetry plane lies on the same axis,
    /// and from the other wall where there are two.
    pub at: f64,
    /// +1: the material lies at larger coordinates (a floor); -1: at smaller ones.
    pub side: f64,
    /// What it does to sliding.
    pub slip: Slip,
    /// What stands behind it.
    pub kind: WallKind,
    /// Its velocity along itself, m/s; 0 across.
    pub velocity: [f64; 3],
}

/// What stands behind a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallKind {
    /// `virtual`: particles on a lattice that extrapolate the material's state (Yang et al. 2020, Eqs 27-32).
    Virtual,
    /// `mirror`: images of the material (ghost particles, Szewc 2017).
    Mirror,
}

/// Condition at a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slip {
    /// `no-slip`: the material sticks.
    NoSlip,
    /// `free-slip`: no shear stress.
    FreeSlip,
}

/// State at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Initial {
    /// Stress.
    pub stress: InitialStress,
    /// How particles are arranged.
    pub lattice: Lattice,
    /// Largest random displacement over spacing, in [0, 0.5).
    pub jitter: f64,
    /// Of the random displacement.
    pub seed: u64,
    /// Passes of relaxation.
    pub relax: u64,
}

/// Arrangement of particles at the start; each has the volume dx^D.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lattice {
    /// `cubic`: squares or cubes with the sides of the spacing.
    Cubic,
    /// `hexagonal`: triangles; in three dimensions hexagonal close packing.
    Hexagonal,
    /// `body-centred`: cubes with a particle in the middle. Three dimensions only.
    BodyCentred,
}

/// Stress at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InitialStress {
    /// `zero`: none.
    Zero,
    /// `pressure`: the same pressure everywhere, Pa.
    Pressure(f64),
    /// `hydrostatic`: the weight above in all directions.
    Hydrostatic,
    /// `k0`: the weight above vertically, `coefficient` times that sideways.
    K0 {
        /// Horizontal over vertical stress; nu/(1-nu) where the scene names none.
        coefficient: f64,
    },
}

/// Numerical parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numerics {
    /// Safety factor of the time step: dt = courant min(h/(c + |v|), sqrt(h/|a|)).
    pub courant: f64,
    /// Safety factor of the time step of viscosity: dt = viscous_courant rho h^2/mu.
    pub viscous_courant: f64,
    /// Artificial viscosity alpha.
    pub viscosity: f64,
    /// Does it act on approaching pairs only?
    pub viscosity_on_approach: bool,
    /// Quadratic artificial viscosity beta, on approaching pairs.
    pub quadratic_viscosity: f64,
    /// Linear damping of the velocity, 1/s. Where the material can flow only if the scene forces it.
    pub damping: f64,
    /// Density over the initial one below which the material has come apart and carries no stress; 0 switches it off.
    /// Only where the mean stress is integrated: one that follows from the density needs no gate.
    pub density_gate: f64,
    /// Diffusion of density delta (delta-SPH); 0 switches it off.
    pub density_diffusion: f64,
    /// Diffusion of stress zeta; 0 switches it off, as in fluids, where stress follows from density and strain rate.
    pub stress_diffusion: f64,
    /// Artificial stress epsilon against clumping in tension; 0 switches it off.
    pub artificial_stress: f64,
    /// Are gradients corrected by the conjugate pair of operators sigma_i L_i + sigma_j L_j?
    pub gradient_correction: bool,
    /// Shifting of particles inside the body; 0 switches it off.
    pub shifting: f64,
    /// Numbers that sums over pairs are made of.
    pub precision: Precision,
}

/// Numbers that the sums over pairs of stress and velocity are made of. All else is f64.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// f64.
    #[default]
    Double,
    /// f32, from differences of places that are as good as f32 can hold. Not along a period.
    Mixed,
}

impl std::fmt::Display for Precision {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Double => "f64",
            Self::Mixed => "mixed precision",
        })
    }
}

/// When the run is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End {
    /// At this time, s.
    pub time: f64,
    /// Earlier, once the kinetic energy falls below this fraction of its peak.
    pub at_rest: Option<f64>,
}

/// What is written while the run goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// Time between snapshots, s.
    pub snapshots: f64,
    /// Time between lines of the history, s.
    pub history: f64,
}

impl Scene {
    /// Checks the text of a scene file; `name` is used in messages, and the files that the scene names are looked for beside
    /// it, or among the copies where it is the scene of a run folder. All faults are reported at once.
    pub fn read(name: &str, text: &str) -> Result<Self, SceneError> {
        Self::read_with(name, text, &Sources::of(std::path::Path::new(name)))
    }

    /// The same with the files that the scene names from `sources`.
    pub fn read_with(name: &str, text: &str, sources: &Sources) -> Result<Self, SceneError> {
        check::scene(name, text, sources)
    }

    /// [`Scene::hash`] of its text, of what the files hold that it names, and of what was chosen where it says `"auto"`.
    pub fn hash_of(&self, text: &str) -> String {
        let hash = Self::hash(text);
        let chosen = self.chosen.as_ref().map_or_else(String::new, Chosen::canonical);
        if self.files.is_empty() && chosen.is_empty() {
            return hash;
        }
        let files: String = self.files.iter().map(|(path, digest)| format!("{path} {digest}\n")).collect();
        crate::provenance::sha256(format!("{hash}\n{files}{chosen}").as_bytes())
    }

    /// Smoothing length h, m.
    pub fn h(&self) -> f64 {
        self.h_over_dx * self.spacing
    }
}
