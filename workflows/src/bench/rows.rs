//! The scenes whose speed is measured: collapsing columns over spaces, laws and kernels.

use crate::failure::Failure;
use formats::{kernel::Kernel, space::Space};

/// One of them, and how it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    pub name: &'static str,
    pub space: Space,
    pub law: Law,
    pub kernel: Kernel,
    /// `numerics.precision`; the scene has that key only where it is not [`DOUBLE`].
    pub precision: &'static str,
    /// Spacing, mm.
    pub spacing: f64,
    /// The time steps are measured from, s: half of the fall at sqrt(H/g) = 0.101 s.
    pub middle: f64,
    /// Steps a launch is measured over.
    pub steps: u64,
}

/// The laws of scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    DruckerPrager,
    MuI,
    ViscoPlastic,
}

/// The precision of a scene that names none.
pub const DOUBLE: &str = "f64";
/// The row that others are compared by.
pub const MAIN: &str = "main";

/// All rows, the main one first: it and `3d` differ in size alone.
pub const ROWS: [Row; 11] = {
    use Kernel::{CubicSpline, WendlandC2};
    use Law::{DruckerPrager, MuI, ViscoPlastic};
    use Space::{Axisymmetric, PlaneStrain, ThreeD};
    [
        Row { spacing: 2.5, steps: 100, ..row(MAIN, ThreeD, DruckerPrager, CubicSpline) },
        Row { spacing: 2.5, steps: 100, precision: "mixed", ..row("main-mixed", ThreeD, DruckerPrager, CubicSpline) },
        row("3d", ThreeD, DruckerPrager, CubicSpline),
        row("3d-wendland", ThreeD, DruckerPrager, WendlandC2),
        row("3d-mu-i", ThreeD, MuI, CubicSpline),
        row("3d-visco-plastic", ThreeD, ViscoPlastic, CubicSpline),
        row("rz", Axisymmetric, DruckerPrager, CubicSpline),
        row("rz-mu-i-wendland", Axisymmetric, MuI, WendlandC2),
        row("plane", PlaneStrain, DruckerPrager, CubicSpline),
        row("plane-mu-i", PlaneStrain, MuI, CubicSpline),
        row("plane-visco-plastic-wendland", PlaneStrain, ViscoPlastic, WendlandC2),
    ]
};

/// Some 25 000 particles in three dimensions, 10 000 in two.
const fn row(name: &'static str, space: Space, law: Law, kernel: Kernel) -> Row {
    let (spacing, steps) = if matches!(space, Space::ThreeD) { (5.0, 300) } else { (1.0, 1000) };
    Row { name, space, law, kernel, precision: DOUBLE, spacing, middle: 0.1, steps }
}

impl Law {
    /// Its name in scenes.
    pub fn name(self) -> &'static str {
        match self {
            Self::DruckerPrager => "drucker-prager",
            Self::MuI => "mu-i",
            Self::ViscoPlastic => "visco-plastic",
        }
    }

    /// Its constants; sound speeds of the fluids are ten times the fall's. The solid viscosity leaves the step to the sound.
    fn constants(self) -> &'static str {
        match self {
            Self::DruckerPrager => "young = \"5.98 MPa\"\npoisson = 0.3\nfriction = \"30 deg\"\ncohesion = \"0 Pa\"",
            Self::MuI => {
                "sound-speed = \"15 m/s\"\nfriction-static = 0.38\nfriction-dynamic = 0.64\ninertial-number = 0.279\n\
                 grain-diameter = \"0.5 mm\"\nunyielded = \"elastic\""
            }
            Self::ViscoPlastic => {
                "sound-speed = \"15 m/s\"\nfriction = \"30 deg\"\ncohesion = \"0 Pa\"\nviscosity = \"1 mPa s\"\n\
                 viscosity-solid = \"20 Pa s\""
            }
        }
    }
}

impl Row {
    /// Coarse, for a few steps, from early on: shows in seconds that everything works.
    pub fn quick(self) -> Self {
        let spacing = if self.space == Space::ThreeD { 12.5 } else { 4.0 };
        Self { spacing, middle: 0.01, steps: 10, ..self }
    }

    /// Its scene, which ends at `time`; nothing is put out soon after the middle.
    pub fn scene(&self, time: f64) -> String {
        let Self { name, space, law, kernel, precision, spacing, middle, .. } = self;
        // Symmetry in the plane, so that images are among what is measured.
        let (symmetry, shape) = match space {
            Space::PlaneStrain => {
                ("symmetry = [\"x\"]\n", "box = { min = [0, 0, 0], max = [\"0.1 m\", 0, \"0.1 m\"] }")
            }
            _ => ("", "cylinder = { radius = \"0.1 m\", height = \"0.1 m\" }"),
        };
        let numerics = match *precision {
            DOUBLE => String::new(),
            other => format!("[numerics]\nprecision = \"{other}\"\n"),
        };
        format!(
            "title = \"Column for measuring speed: {name}\"\nspace = \"{}\"\nspacing = \"{spacing} mm\"\n{symmetry}\
             [kernel]\nkind = \"{}\"\n[material.{}]\ndensity = \"2600 kg/m3\"\n{}\n[body.column]\n{shape}\n\
             [wall.floor]\naxis = \"z\"\nat = \"0 m\"\nside = \"above\"\nslip = \"no-slip\"\n{numerics}\
             [end]\ntime = \"{time} s\"\n[output]\nsnapshots = \"{middle} s\"\nhistory = \"{middle} s\"\n",
            space.name(),
            kernel.name(),
            law.name(),
            law.constants()
        )
    }

    /// Operations a pair within the support costs by the formulae, additions, multiplications, divisions, roots, minima and
    /// maxima counting one each: the distance and the kernel's slope once, then `velocity_gradient` and `momentum` (stress
    /// and linear artificial viscosity) of sph-run's `rates`. What is spent on pairs outside the support, on material, walls
    /// and lists, and on stabilisers, is not counted.
    pub fn operations(&self) -> u64 {
        let d = self.space.dimension() as u64;
        let slope = match self.kernel {
            // -(2 - q)^2/(2 q)
            Kernel::CubicSpline => 4,
            // -5 (1 - q/2)^3
            Kernel::WendlandC2 => 5,
        };
        // x_ij, its square, the root, q, the slope and its scale.
        let distance = d + (2 * d - 1) + 2 + slope + 1;
        // V W', v_ij, times each other, and the outer product added up.
        let gradient = 1 + d + d + 2 * d * d;
        // In r-z the viscosity weighs with the mean radius.
        let metric = if self.space == Space::Axisymmetric { 3 } else { 0 };
        // v_ij . x_ij (with v_ij), min, max, two of the push, V W'; sigma_i + sigma_j; its product with x_ij; the push along
        // x_ij, added, weighed, added up; the heat.
        let momentum = d + (2 * d - 1) + 2 + 2 + 1 + d * (d + 1) / 2 + (2 * d * d - d) + 4 * d + 3 + metric;
        distance + gradient + momentum
    }
}

/// Rows whose names contain one of these words; all where there is none. `main` is no part of another name.
///
/// # Errors
/// Where a word is in no name.
pub fn chosen(words: &[String]) -> Result<Vec<Row>, Failure> {
    if let Some(word) = words.iter().find(|word| !ROWS.iter().any(|row| row.name.contains(word.as_str()))) {
        let names: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
        return Err(Failure::usage(format!("--rows: no row is named like `{word}`; there are: {}", names.join(", "))));
    }
    let is_chosen = |row: &Row| words.is_empty() || words.iter().any(|word| row.name.contains(word.as_str()));
    Ok(ROWS.into_iter().filter(is_chosen).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::scene::Scene;

    #[test]
    fn all_scenes_are_valid_and_differ() {
        let mut texts = Vec::new();
        for row in ROWS.into_iter().flat_map(|row| [row, row.quick()]) {
            let text = row.scene(row.middle);
            let scene = Scene::read(row.name, &text).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!((scene.space, scene.kernel, scene.end.time), (row.space, row.kernel, row.middle));
            assert_eq!(text.contains("precision"), row.precision != DOUBLE, "{text}");
            texts.push(text);
        }
        texts.sort();
        texts.dedup();
        assert_eq!(texts.len(), 2 * ROWS.len());
        // A run goes on towards a later end.
        let [now, later] = [0.1, 1.1].map(|time| ROWS[0].scene(time));
        assert_eq!(Scene::changes("scene", &now, &later).unwrap().len(), 1);
    }

    #[test]
    fn precision_is_said_where_it_is_not_double() {
        let mixed = Row { precision: "mixed", ..ROWS[0] };
        assert!(mixed.scene(1.0).contains("[numerics]\nprecision = \"mixed\"\n"));
    }

    #[test]
    fn operations_by_hand() {
        // Distance 3 + 5 + 1 + 1 + 4 + 1; gradient 1 + 3 + 3 + 18; momentum 8 + 2 + 2 + 1 + 6 + 15 + 3 + 3 + 3 + 3 + 3.
        assert_eq!((ROWS[0].name, ROWS[0].operations()), ("main", 15 + 25 + 49));
        let of = |name: &str| ROWS.iter().find(|row| row.name == name).unwrap().operations();
        assert_eq!((of("plane"), of("rz"), of("3d-wendland")), (12 + 13 + 30, 12 + 13 + 33, 90));
    }

    #[test]
    fn rows_are_chosen_by_parts_of_their_names() {
        let names = |words: &[&str]| -> Vec<&str> {
            let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
            chosen(&words).unwrap().iter().map(|row| row.name).collect()
        };
        assert_eq!(names(&[]).len(), ROWS.len());
        assert_eq!(names(&["main"]), ["main", "main-mixed"]);
        assert_eq!(names(&["rz", "plane-mu"]), ["rz", "rz-mu-i-wendland", "plane-mu-i"]);
        let failure = chosen(&["plain".into()]).unwrap_err();
        assert!(failure.code == formats::exit::USAGE && failure.message.contains("plane-mu-i"), "{failure}");
    }
}
