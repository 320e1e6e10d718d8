//! `tests/stability`: `methods.toml`, the columns of the map, and a file for each of its rows.

use crate::{
    failure::Failure,
    paths, shelf,
    study::{
        cost,
        definition::{Named, Run, Study},
        expression,
        template::{self, Value},
    },
};
use formats::scene::Scene;
use serde::Deserialize;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use toml::Table;

/// The whole map.
#[derive(Debug)]
pub struct Map {
    /// Columns, in order.
    pub methods: Vec<Method>,
    /// Rows, in order.
    pub rows: Vec<Row>,
    /// Numbers every expression may name.
    pub constants: Vec<(String, Value)>,
    /// The runs: a series for each row, `method` the parameter.
    pub study: Study,
}

/// A column: what is laid over every scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Method {
    /// For the names of runs.
    pub name: String,
    /// For people.
    pub title: String,
    /// Its law; Drucker-Prager where nothing is said.
    #[serde(default = "drucker_prager")]
    pub material: String,
    /// Keys of the scene.
    #[serde(default)]
    pub set: Table,
}

/// A row: one scene in which something fails, and the number that tells.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Name of its file.
    #[serde(skip)]
    pub name: String,
    /// Which failure: 1 to 20.
    pub failure: u32,
    /// One line, short enough for the picture.
    pub title: String,
    /// What goes wrong, in one line.
    pub why: String,
    /// What was expected of the methods, before it was run.
    pub expected: String,
    /// What came of it.
    #[serde(default)]
    pub found: String,
    /// What is measured, for people: `title = expression`.
    pub measure: Named,
    /// Up to here it holds, from here where `degrades` is less.
    pub holds: f64,
    /// Up to here (from here) it degrades; beyond it fails.
    pub degrades: f64,
    /// The method whose numbers are those that begin with `reference.`.
    #[serde(default)]
    pub reference: Option<String>,
    /// Methods that have a meaning here.
    pub methods: Vec<String>,
    /// Another row, whose runs this one looks at with its own measure.
    #[serde(default)]
    pub runs_of: Option<String>,
    /// The scene without its material; with `runs_of` there is none.
    #[serde(default)]
    pub scene: Table,
    /// Keys over those of the materials in methods.toml.
    #[serde(default)]
    pub material: Table,
    /// Keys for one method more, by its name.
    #[serde(default)]
    pub set: BTreeMap<String, Table>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Methods {
    #[serde(default)]
    constants: BTreeMap<String, f64>,
    materials: Table,
    method: Vec<Method>,
}

fn drucker_prager() -> String {
    "drucker-prager".into()
}

/// The parameter of the runs.
const METHOD: &str = "method";
/// File of the columns.
const METHODS: &str = "methods.toml";
/// How many failures there are.
pub const FAILURES: u32 = 20;
/// Names that begin with this are the numbers of the method of reference.
const REFERENCE: &str = "reference.";

/// What `sph-post` writes into `summary.json`, as far as it is a number.
pub const KEYS: [&str; 48] = [
    "final_time_s",
    "particles",
    "r0_m",
    "final_front_m",
    "final_front_mass_99_5_m",
    "final_front_thickness_m",
    "runout_furthest",
    "runout_mass_99_5",
    "runout_thickness",
    "runout_true",
    "runout_effective",
    "stray_particles",
    "stray_mass_share",
    "final_height_m",
    "max_height_m",
    "volume_ratio",
    "front_mass_last_T",
    "kinetic_over_peak",
    "peak_speed_m_s",
    "basal_level_m",
    "basal_force_over_weight",
    "basal_centre_ratio",
    "basal_max_distance_m",
    "static_speed_m_s",
    "static_share",
    "failure_angle_deg",
    "mechanical_loss_share",
    "energy_closure",
    "dissipated_share",
    "nearest_distance_dx",
    "close_share",
    "pieces",
    "kernel_sum_mean",
    "kernel_sum_scatter",
    "stress_noise",
    "stress_noise_static",
    "tension_share",
    "density_noise",
    "density_lowest",
    "density_highest",
    "loose_share",
    "pressure_peak_Pa",
    "final_speed_rms_m_s",
    "displacement_rms_dx",
    "angular_momentum_change",
    "front_uneven_round",
    "deepest_behind_wall_dx",
    "axis_void",
];

impl Map {
    /// Reads the folder; every scene and expression in it is checked.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let methods: Methods = shelf::parsed(&folder.join(METHODS))?;
        let mut names = Vec::new();
        let entries = std::fs::read_dir(folder)
            .map_err(|e| Failure::no_input(format!("{}: cannot list it: {e}", paths::short(folder).display())))?;
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            names.extend(name.strip_suffix(".toml").filter(|_| name != METHODS).map(str::to_owned));
        }
        names.sort();
        let constants: Vec<(String, Value)> =
            methods.constants.iter().map(|(name, value)| (name.clone(), Value::Number(*value))).collect();
        let (mut rows, mut runs, mut keys) = (Vec::new(), Vec::new(), Vec::new());
        for name in names {
            let path = folder.join(format!("{name}.toml"));
            let fault = |e: String| shelf::fault(&path, &e);
            let row = Row { name, ..shelf::parsed(&path)? };
            row.check(&methods.method, &constants, &mut keys).map_err(fault)?;
            let is_of = |method: &&Method| row.runs_of.is_none() && row.methods.contains(&method.name);
            for method in methods.method.iter().filter(is_of) {
                runs.push(row.run(method, &methods.materials, &constants).map_err(fault)?);
            }
            rows.push(row);
        }
        for row in &rows {
            let path = folder.join(format!("{}.toml", row.name));
            let fault = |e: String| shelf::fault(&path, &e);
            row.check_shared(&rows).map_err(fault)?;
        }
        let measures = keys.into_iter().map(Named::from).collect();
        let study = Study {
            name: "stability".into(),
            folder: folder.to_owned(),
            words: "stability".into(),
            place: paths::study_runs("stability"),
            may_break_down: true,
            title: "Where methods fail".into(),
            series: rows.iter().map(|row: &Row| row.name.clone()).collect(),
            parameters: vec![METHOD.into()],
            constants: Vec::new(),
            measures,
            numbers: Default::default(),
            references: Vec::new(),
            runs,
            tables: Vec::new(),
            pictures: Vec::new(),
            copies: Vec::new(),
        };
        Ok(Self { methods: methods.method, rows, constants, study })
    }

    /// Names of the series of the rows that a user wants: `F01` is all rows of that failure, `f01a-patch` one.
    pub fn rows_of(&self, only: &[String]) -> Result<Vec<String>, Failure> {
        let mut names = Vec::new();
        for wanted in only {
            let number = wanted.to_lowercase().strip_prefix('f').and_then(|rest| rest.parse::<u32>().ok());
            let is_meant = |row: &&Row| number == Some(row.failure) || row.name.eq_ignore_ascii_case(wanted);
            let before = names.len();
            names.extend(self.rows.iter().filter(is_meant).map(|row| row.series().to_owned()));
            if names.len() == before {
                let known = self.study.series.join(", ");
                return Err(Failure::usage(format!("no row `{wanted}`; there are F1 to F{FAILURES}, and: {known}")));
            }
        }
        Ok(names)
    }

    /// The run of a cell; none where it has no meaning.
    pub fn run(&self, row: &Row, method: &str) -> Option<&Run> {
        let is_of = |run: &&Run| run.series == row.series() && run.parameters[0].1 == Value::Text(method.into());
        self.study.runs.iter().find(is_of).filter(|_| row.methods.iter().any(|name| name == method))
    }
}

impl Row {
    /// The series of its runs.
    pub fn series(&self) -> &str {
        self.runs_of.as_ref().unwrap_or(&self.name)
    }

    /// With `runs_of`: are there such runs?
    fn check_shared(&self, rows: &[Self]) -> Result<(), String> {
        let Some(name) = &self.runs_of else { return Ok(()) };
        let other = rows.iter().find(|row| row.name == *name && row.runs_of.is_none());
        let other = other.ok_or_else(|| format!("runs_of: there is no row `{name}` with runs of its own"))?;
        if !self.scene.is_empty() || !self.material.is_empty() || !self.set.is_empty() {
            return Err("runs_of: scene, material and set are those of the other row".into());
        }
        match self.methods.iter().find(|method| !other.methods.contains(method)) {
            Some(method) => Err(format!("runs_of: `{name}` has no runs of `{method}`")),
            None => Ok(()),
        }
    }

    /// Does all exist that it names? The keys of `summary.json` that its measure needs are added to `keys`.
    fn check(&self, methods: &[Method], constants: &[(String, Value)], keys: &mut Vec<String>) -> Result<(), String> {
        if !(1..=FAILURES).contains(&self.failure) {
            return Err(format!("failure: F{} is none of F1 to F{FAILURES}", self.failure));
        }
        let of_file = self.name.get(1..3).and_then(|digits| digits.parse::<u32>().ok());
        if !self.name.starts_with('f') || of_file != Some(self.failure) {
            return Err(format!("failure: the name of a file with F{} begins with f{:02}", self.failure, self.failure));
        }
        if self.scene.is_empty() && self.runs_of.is_none() {
            return Err("scene: it is missing; or name the row whose runs these are in runs_of".into());
        }
        if !(self.holds.is_finite() && self.degrades.is_finite() && self.holds != self.degrades) {
            return Err("holds, degrades: two different numbers, for something must lie between".into());
        }
        let known = |name: &String| methods.iter().any(|method| method.name == *name);
        for (key, names) in [("methods", &self.methods), ("set", &self.set.keys().cloned().collect())] {
            if let Some(name) = names.iter().find(|name| !known(name)) {
                let all: Vec<&str> = methods.iter().map(|method| method.name.as_str()).collect();
                return Err(format!("{key}: there is no method `{name}`; {METHODS} has: {}", all.join(", ")));
            }
        }
        if let Some(name) = self.set.keys().find(|name| !self.methods.contains(name)) {
            return Err(format!("set.{name}: it is not among the methods"));
        }
        match &self.reference {
            Some(name) if !self.methods.contains(name) => {
                return Err(format!("reference: `{name}` is not among the methods"));
            }
            _ => {}
        }
        let found = RefCell::new(Vec::new());
        let lookup = |name: &str| {
            let key = match name.strip_prefix(REFERENCE) {
                Some(key) => self.reference.as_ref().map(|_| key)?,
                None => name,
            };
            let is_constant = constants.iter().any(|(known, _)| known == name);
            if !is_constant && KEYS.contains(&key) {
                found.borrow_mut().push(key.to_owned());
            }
            (is_constant || KEYS.contains(&key)).then_some(1.0)
        };
        expression::evaluate(&self.measure.expression, &lookup).map_err(|e| format!("measure: {e}"))?;
        for key in found.into_inner() {
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        Ok(())
    }

    fn run(&self, method: &Method, materials: &Table, constants: &[(String, Value)]) -> Result<Run, String> {
        let name = format!("{}-{}", self.name, method.name);
        let of = |table: &Table| {
            let law = table.get(&method.material).cloned();
            Table::from_iter([(
                "material".into(),
                Table::from_iter(law.map(|law| (method.material.clone(), law))).into(),
            )])
        };
        if !materials.contains_key(&method.material) {
            return Err(format!("{name}: there is no material `{}`", method.material));
        }
        let none = Table::new();
        let own = self.set.get(&method.name).unwrap_or(&none);
        let sets = [&of(materials), &self.scene, &of(&self.material), &method.set, own];
        let scene = template::scene("", &sets, constants).map_err(|e| format!("{name}: {e}"))?;
        let checked = Scene::read(&name, &scene).map_err(|e| e.to_string())?;
        let parameters = vec![(METHOD.to_owned(), Value::Text(method.name.clone()))];
        Ok(Run { name, series: self.name.clone(), parameters, scene, seconds: cost::seconds(&checked) })
    }
}
