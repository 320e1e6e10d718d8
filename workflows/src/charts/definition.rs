//! `chart.toml`: a case with a reference, the settings it is run with, and what counts as error. See `tests/charts/README.md` for every
//! key.

use crate::{
    failure::Failure,
    paths,
    shelf::{self, Shelf},
    study::{
        definition::{Named, Run, Study, value},
        expression,
        numbers::{Field, Measured, Numbers},
        template::Value,
    },
};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::Table;

/// Series of the runs in which nothing is changed.
pub const BASE: &str = "base";
/// Series of the runs in which two options are taken at a time.
pub const PAIRS: &str = "pairs";
/// Between the names of two options.
const AND: &str = "-and-";

/// One folder of tests/charts.
#[derive(Debug)]
pub struct Chart {
    /// Its runs, as far as they are known: pairs are added once they are chosen.
    pub study: Study,
    /// What counts.
    pub error: Error,
    /// Columns of the table beside the error.
    pub also: Vec<Named>,
    /// What is put into the place of the base.
    pub choices: Vec<Choice>,
    /// Of the combinations.
    pub pairs: Pairs,
    /// Which runs tell what a reduced model costs.
    pub reduction: Option<Reduction>,
    /// Charts whose settings are compared with the default together.
    pub group: Option<String>,
    /// Names and texts of the templates, in order.
    scene: Vec<(String, String)>,
    /// Laid over the template in every run.
    set: Table,
}

/// The ordinate.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Error {
    /// For the axis.
    pub title: String,
    /// A sentence.
    pub words: String,
    /// Of measures and constants.
    pub expression: String,
    /// Below this the reference itself is not known better.
    pub reference: Option<f64>,
    /// What that is taken from.
    #[serde(default, rename = "reference-words")]
    pub reference_words: String,
}

/// A group of options that exclude each other.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// A series.
    pub name: String,
    /// Do its options make another material, one that the scene's author has not asked for?
    #[serde(default)]
    pub material: bool,
    /// At least one.
    #[serde(rename = "option")]
    pub options: Vec<Setting>,
}

/// One thing that differs from the base.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// One word; no other option has it.
    pub name: String,
    /// Keys laid over the template.
    #[serde(default)]
    pub set: Table,
    /// Files of the template, and those that are taken instead.
    #[serde(default)]
    pub instead: BTreeMap<String, String>,
    /// In place of those of the chart's options.
    pub resolutions: Option<Vec<f64>>,
    /// In place of those of the chart's options.
    pub seeds: Option<u32>,
    /// Is it left out of the combinations?
    #[serde(default)]
    pub alone: bool,
}

/// Resolutions, and lattices at each.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Particles over the length the case is measured by.
    pub resolutions: Vec<f64>,
    /// Lattices that are disturbed, each in its own way.
    pub seeds: u32,
}

/// Combinations of two options.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pairs {
    /// Not more than so many.
    pub most: usize,
    /// At this resolution.
    pub resolution: f64,
    /// The best of the scene's own material also at this one.
    pub lower: Option<f64>,
    /// Lattices.
    pub seeds: u32,
}

/// What a reduced model costs: the base and the options of a choice at one resolution.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reduction {
    /// Name of the choice; its last option is the full model.
    pub choice: String,
    /// Of all of them.
    pub resolution: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    title: String,
    group: Option<String>,
    measures: Vec<Named>,
    #[serde(default)]
    also: Vec<Named>,
    scene: Vec<String>,
    #[serde(default)]
    constants: Table,
    #[serde(default)]
    set: Table,
    error: Error,
    base: Sweep,
    options: Sweep,
    pairs: Pairs,
    reduction: Option<Reduction>,
    #[serde(default, rename = "choice")]
    choices: Vec<Choice>,
    #[serde(default, rename = "field")]
    fields: Vec<Field>,
    profile: Option<RawProfile>,
    #[serde(default)]
    stations: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawProfile {
    file: PathBuf,
    curve: String,
    #[serde(default = "one")]
    scale: f64,
}

fn one() -> f64 {
    1.0
}

/// All charts.
pub fn shelf() -> Shelf {
    Shelf { folder: paths::charts(), file: "chart.toml", kind: "chart" }
}

impl Chart {
    /// Reads the chart of a name.
    pub fn named(name: &str) -> Result<Self, Failure> {
        Self::read(name, &shelf().find(name)?)
    }

    /// Reads the chart in a folder; every scene and expression in it is checked.
    pub fn read(name: &str, folder: &Path) -> Result<Self, Failure> {
        let path = folder.join(shelf().file);
        Self::checked(name, folder, shelf::parsed(&path)?).map_err(|e| shelf::fault(&path, &e))
    }

    fn checked(name: &str, folder: &Path, raw: Raw) -> Result<Self, String> {
        let constants: Vec<(String, Value)> =
            raw.constants.iter().map(|(k, v)| Ok((k.clone(), value(v)?))).collect::<Result<_, String>>()?;
        let plain = |(name, value): &(String, Value)| match value {
            Value::Number(number) => Some((name.clone(), *number)),
            Value::Text(_) => None,
        };
        let profile = raw.profile.map(|p| Measured { file: folder.join(p.file), curve: p.curve, scale: p.scale });
        let numbers = Numbers {
            fields: raw.fields,
            profile,
            stations: raw.stations,
            constants: constants.iter().filter_map(plain).collect(),
        };
        let mut measures = raw.measures;
        measures.extend(numbers.names().into_iter().map(Named::from));
        let series = [BASE].into_iter().chain(raw.choices.iter().map(|choice| choice.name.as_str())).chain([PAIRS]);
        let series: Vec<String> = series.map(str::to_owned).collect();
        let template = |name: &String| Ok::<_, String>((name.clone(), template(folder, name)?));
        let mut chart = Self {
            study: Study {
                name: name.to_owned(),
                folder: folder.to_owned(),
                words: format!("chart {name}"),
                place: paths::chart_runs(name),
                may_break_down: true,
                title: raw.title,
                series,
                parameters: ["setting", "resolution", "seed"].map(str::to_owned).to_vec(),
                constants,
                measures,
                numbers,
                references: Vec::new(),
                runs: Vec::new(),
                tables: Vec::new(),
                pictures: Vec::new(),
                copies: Vec::new(),
            },
            error: raw.error,
            also: raw.also,
            choices: raw.choices,
            pairs: raw.pairs,
            reduction: raw.reduction,
            group: raw.group,
            scene: raw.scene.iter().map(template).collect::<Result<_, _>>()?,
            set: raw.set,
        };
        chart.check()?;
        chart.study.runs = chart.runs(BASE, &[], &raw.base.resolutions, raw.base.seeds)?;
        for choice in chart.choices.clone() {
            for option in &choice.options {
                let resolutions = option.resolutions.as_ref().unwrap_or(&raw.options.resolutions);
                let seeds = option.seeds.unwrap_or(raw.options.seeds);
                let runs = chart.runs(&choice.name, &[option], resolutions, seeds);
                chart.study.runs.extend(runs.map_err(|e| format!("choice {}: {e}", choice.name))?);
            }
        }
        Ok(chart)
    }

    /// The option of a name, and the number of its choice.
    pub fn option(&self, name: &str) -> Option<(usize, &Setting)> {
        let named = |(k, choice): (usize, &'_ Choice)| choice.options.iter().any(|o| o.name == name).then_some(k);
        let k = self.choices.iter().enumerate().find_map(named)?;
        Some((k, self.choices[k].options.iter().find(|option| option.name == name)?))
    }

    /// Has a setting, an option or two with ` and ` between them, another material than the base?
    pub fn is_other_material(&self, setting: &str) -> bool {
        setting.split(" and ").filter_map(|name| self.option(name)).any(|(k, _)| self.choices[k].material)
    }

    /// The runs of two options together. A fault where they do not go together, such as two laws or a key the other law has not.
    pub fn pair(&self, first: &str, second: &str, resolutions: &[f64]) -> Result<Vec<Run>, String> {
        let option = |name: &str| self.option(name).ok_or_else(|| format!("there is no option `{name}`"));
        let ((one, first), (other, second)) = (option(first)?, option(second)?);
        if one == other {
            return Err(format!("`{}` and `{}` exclude each other", first.name, second.name));
        }
        if first.instead.keys().any(|file| second.instead.contains_key(file)) {
            return Err(format!("`{}` and `{}` replace the same file", first.name, second.name));
        }
        self.runs(PAIRS, &[first, second], resolutions, self.pairs.seeds)
    }

    /// The runs of a setting, of none for the base.
    fn runs(&self, series: &str, options: &[&Setting], resolutions: &[f64], seeds: u32) -> Result<Vec<Run>, String> {
        let mut texts = Vec::new();
        for (name, text) in &self.scene {
            match options.iter().find_map(|option| option.instead.get(name)) {
                Some(other) => texts.push(template(&self.study.folder, other)?),
                None => texts.push(text.clone()),
            }
        }
        let (text, name) = (texts.join("\n"), options.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().join(AND));
        let sets: Vec<&Table> = [&self.set].into_iter().chain(options.iter().map(|option| &option.set)).collect();
        let mut runs = Vec::new();
        for &resolution in resolutions {
            for seed in 1..=seeds {
                let setting = (!options.is_empty()).then(|| ("setting".to_owned(), Value::Text(name.clone())));
                let lattice = [("resolution", resolution), ("seed", f64::from(seed))];
                let lattice = lattice.map(|(key, number)| (key.to_owned(), Value::Number(number)));
                let parameters = setting.into_iter().chain(lattice).collect();
                runs.push(Run::new(series, &text, &sets, parameters, &self.study.constants)?);
            }
        }
        Ok(runs)
    }

    fn check(&self) -> Result<(), String> {
        let mut seen: Vec<&str> = Vec::new();
        for choice in &self.choices {
            let place = |e: String| format!("choice {}: {e}", choice.name);
            if [BASE, PAIRS].contains(&choice.name.as_str()) {
                return Err(place("this name is taken".into()));
            }
            for option in &choice.options {
                if seen.contains(&option.name.as_str()) || option.name.contains(AND) {
                    let reason = format!("option `{}`: another one has this name, or it holds `{AND}`", option.name);
                    return Err(place(reason));
                }
                let files = option.instead.keys();
                if let Some(file) = files.into_iter().find(|file| !self.scene.iter().any(|(name, _)| name == *file)) {
                    return Err(place(format!("option {}: `{file}` is none of the scene's files", option.name)));
                }
                seen.push(&option.name);
            }
        }
        for measure in &self.study.measures {
            expression::evaluate(&measure.expression, &|_| Some(1.0))?;
            if measure.title.contains([',', ' ', '"']) {
                return Err(format!("measure `{}`: its name is a column of results.csv: one word", measure.title));
            }
        }
        for field in &self.study.numbers.fields {
            field.check(&self.study.numbers.constants).map_err(|e| format!("field {}: {e}", field.name))?;
        }
        let known = |name: &str| {
            let is_measure = self.study.measures.iter().any(|measure| measure.title == name);
            (is_measure || self.study.constants.iter().any(|(known, _)| known == name)).then_some(1.0)
        };
        expression::evaluate(&self.error.expression, &known).map_err(|e| format!("error: {e}"))?;
        for column in &self.also {
            expression::evaluate(&column.expression, &known).map_err(|e| format!("also: {e}"))?;
        }
        if let Some(measured) = &self.study.numbers.profile {
            measured.read().map_err(|e| format!("profile: {e}"))?;
        }
        if let Some(reduction) = &self.reduction {
            let is_there = self.choices.iter().any(|choice| choice.name == reduction.choice);
            let has_stations = !self.study.numbers.stations.is_empty();
            if !is_there || !has_stations {
                return Err(format!("reduction: it needs stations, and a choice `{}`", reduction.choice));
            }
        }
        Ok(())
    }
}

fn template(folder: &Path, name: &str) -> Result<String, String> {
    std::fs::read_to_string(folder.join(name)).map_err(|e| format!("{name}: cannot read the template: {e}"))
}
