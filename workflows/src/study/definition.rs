//! `study.toml`: which runs a study has, what is kept of each, and the tables and pictures made of them. See
//! `tests/validation/README.md` for every key.

use super::{
    cost, expression,
    numbers::Numbers,
    reference::{self, Reference},
    template::{self, Value, tidy},
};
use crate::{
    failure::Failure,
    paths,
    shelf::{self, Shelf},
};
use formats::scene::Scene;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::Table;

/// One folder of tests/validation with a `study.toml`.
#[derive(Debug)]
pub struct Study {
    /// Its folder's name.
    pub name: String,
    /// The folder.
    pub folder: PathBuf,
    /// The words of the command line that carry it out: `study columns`.
    pub words: String,
    /// Where its run folders lie.
    pub place: PathBuf,
    /// Is a computation that breaks down (exit code 70) a result, and no failure?
    pub may_break_down: bool,
    /// One line.
    pub title: String,
    /// Names of the series, in order.
    pub series: Vec<String>,
    /// Names of the parameters, in order of appearance.
    pub parameters: Vec<String>,
    /// Numbers every expression may name.
    pub constants: Vec<(String, Value)>,
    /// What is kept of each run.
    pub measures: Vec<Named>,
    /// What measures may name beyond the keys of `summary.json`.
    pub numbers: Numbers,
    /// Curves to compare with.
    pub references: Vec<Reference>,
    /// All runs of all series.
    pub runs: Vec<Run>,
    /// Tables of the page.
    pub tables: Vec<Tabulated>,
    /// Pictures.
    pub pictures: Vec<Picture>,
    /// Pictures that `sph-post` made of one run.
    pub copies: Vec<Copied>,
}

/// One run.
#[derive(Clone, Debug)]
pub struct Run {
    /// Series and parameters: `drucker-prager-aspect-0.5-resolution-25`.
    pub name: String,
    /// Its series.
    pub series: String,
    /// Its parameters.
    pub parameters: Vec<(String, Value)>,
    /// The scene file's text.
    pub scene: String,
    /// About how long it takes on one rank, s.
    pub seconds: f64,
}

/// `title = expression`, or an expression that is its own title.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(from = "String")]
pub struct Named {
    /// For people.
    pub title: String,
    /// What it is.
    pub expression: String,
}

impl From<String> for Named {
    fn from(text: String) -> Self {
        let (title, expression) = text.rsplit_once(" = ").unwrap_or((&text, &text));
        Self { title: title.trim().to_owned(), expression: expression.trim().to_owned() }
    }
}

/// Which runs: every one where nothing is said.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// Series.
    #[serde(default)]
    pub series: Vec<String>,
    /// Parameters: a value; `[lowest, highest]`; or a list of names.
    #[serde(default, rename = "where")]
    pub only: Table,
}

/// A table of the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tabulated {
    /// Its marker is `study/name`.
    pub name: String,
    /// One a column.
    pub columns: Vec<Named>,
    /// Series of it.
    #[serde(default)]
    pub series: Vec<String>,
    /// Runs of it.
    #[serde(default, rename = "where")]
    pub only: Table,
    /// Series whose run of the same other parameters gives the names that begin with `other.`.
    pub beside: Option<String>,
    /// Means over the runs that agree in these parameters (or `series`), in place of a line a run.
    #[serde(default)]
    pub mean: Vec<String>,
    /// With `mean`: the standard deviation of the runs behind each mean.
    #[serde(default)]
    pub spread: bool,
    /// With `mean`: power laws of this parameter, c x^n by least squares of the logarithms, in place of means.
    pub fit: Option<String>,
}

/// A picture of one or more panels side by side.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    /// Its marker is `study/name`, its file docs/validation/study-name.png.
    pub name: String,
    /// One line, for those who cannot see it.
    pub title: String,
    /// Logarithmic axes?
    #[serde(default)]
    pub log: bool,
    /// From the left.
    #[serde(rename = "panel")]
    pub panels: Vec<Panel>,
    /// Curves of the panels that have none of their own.
    #[serde(default, rename = "curve")]
    pub curves: Vec<Curve>,
}

/// A pair of axes.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Panel {
    /// Title and expression of the abscissa.
    pub x: Named,
    /// Of the ordinate.
    pub y: Named,
    /// Names of references.
    #[serde(default)]
    pub references: Vec<String>,
    /// Its own curves.
    #[serde(default, rename = "curve")]
    pub curves: Vec<Curve>,
}

/// A curve through runs.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// For the legend.
    pub label: String,
    /// Series.
    #[serde(default)]
    pub series: Vec<String>,
    /// Runs.
    #[serde(default, rename = "where")]
    pub only: Table,
    /// In place of the panel's.
    pub y: Option<String>,
}

/// A picture in a run's `post` folder that is kept.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Copied {
    /// Its marker is `study/name`, its file docs/validation/study-name.png.
    pub name: String,
    /// One line, for those who cannot see it.
    pub title: String,
    /// Name of the run.
    pub run: String,
    /// Its file in `post/`.
    pub file: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    title: String,
    measures: Vec<Named>,
    #[serde(default)]
    constants: Table,
    series: Vec<RawSeries>,
    #[serde(default)]
    reference: Vec<reference::Raw>,
    #[serde(default)]
    table: Vec<Tabulated>,
    #[serde(default)]
    picture: Vec<Picture>,
    #[serde(default)]
    copy: Vec<Copied>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSeries {
    name: String,
    scene: Vec<String>,
    #[serde(default)]
    set: Table,
    #[serde(default)]
    variants: Vec<Variant>,
    values: Vec<Table>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Variant {
    name: String,
    #[serde(default)]
    set: Table,
}

/// All studies.
pub fn shelf() -> Shelf {
    Shelf { folder: paths::validation(), file: "study.toml", kind: "study" }
}

impl Run {
    /// The run of a series with these parameters: the template `text` with each of `sets` laid over it, checked.
    pub fn new(
        series: &str,
        text: &str,
        sets: &[&Table],
        parameters: Vec<(String, Value)>,
        constants: &[(String, Value)],
    ) -> Result<Self, String> {
        let name = parameters.iter().fold(series.to_owned(), |name, (key, value)| match value {
            Value::Text(text) => format!("{name}-{text}"),
            Value::Number(_) => format!("{name}-{key}-{value}"),
        });
        let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '.' || c == '_';
        if let Some(odd) = name.chars().find(|&c| !fits(c)) {
            return Err(format!("`{name}` would be a folder's name, where `{odd}` is not wanted"));
        }
        let values: Vec<_> = parameters.iter().chain(constants).cloned().collect();
        let scene = template::scene(text, sets, &values).map_err(|e| format!("{name}: {e}"))?;
        let checked = Scene::read(&name, &scene).map_err(|e| format!("{name}: {e}"))?;
        Ok(Self { name, series: series.to_owned(), parameters, scene, seconds: cost::seconds(&checked) })
    }
}

impl Study {
    /// Reads the study of a name.
    pub fn named(name: &str) -> Result<Self, Failure> {
        Self::read(name, &shelf().find(name)?)
    }

    /// Reads the study in a folder; every scene and expression in it is checked.
    pub fn read(name: &str, folder: &Path) -> Result<Self, Failure> {
        let path = folder.join(shelf().file);
        let fault = |e: String| shelf::fault(&path, &e);
        let raw: Raw = shelf::parsed(&path)?;
        let constants: Vec<(String, Value)> =
            raw.constants.iter().map(|(k, v)| Ok((k.clone(), value(v)?))).collect::<Result<_, _>>().map_err(fault)?;
        let mut study = Self {
            name: name.to_owned(),
            folder: folder.to_owned(),
            words: format!("study {name}"),
            place: paths::study_runs(name),
            may_break_down: false,
            title: raw.title,
            series: raw.series.iter().map(|series| series.name.clone()).collect(),
            parameters: Vec::new(),
            constants,
            measures: raw.measures,
            numbers: Numbers::default(),
            references: Vec::new(),
            runs: Vec::new(),
            tables: raw.table,
            pictures: raw.picture,
            copies: raw.copy,
        };
        for series in &raw.series {
            let runs = study.runs_of(series).map_err(|e| fault(format!("series {}: {e}", series.name)))?;
            for run in runs {
                if study.runs.iter().any(|known| known.name == run.name) {
                    return Err(fault(format!("series {}: the run {} is there twice", series.name, run.name)));
                }
                study.runs.push(run);
            }
        }
        for run in &study.runs {
            for (name, _) in &run.parameters {
                if !study.parameters.contains(name) {
                    study.parameters.push(name.clone());
                }
            }
        }
        study.references = reference::read(folder, raw.reference).map_err(fault)?;
        study.check().map_err(fault)?;
        Ok(study)
    }

    /// Are these series of it?
    pub fn check_series(&self, names: &[String]) -> Result<(), Failure> {
        let Some(unknown) = names.iter().find(|name| !self.series.contains(name)) else { return Ok(()) };
        let (words, known) = (&self.words, self.series.join(", "));
        Err(Failure::usage(format!("{words} has no series `{unknown}`; it has: {known}")))
    }

    /// The runs of a choice, in the order of the study.
    pub fn chosen(&self, choice: &Choice) -> Vec<&Run> {
        let meets = |run: &Run| choice.only.iter().all(|(key, wanted)| meets(run, key, wanted));
        let is_of = |run: &Run| choice.series.is_empty() || choice.series.contains(&run.series);
        self.runs.iter().filter(|run| is_of(run) && meets(run)).collect()
    }

    /// The names that have markers in the page.
    #[cfg(test)]
    pub fn marked(&self) -> Vec<String> {
        let tables = self.tables.iter().map(|table| &table.name);
        let pictures = self.pictures.iter().map(|p| &p.name).chain(self.copies.iter().map(|c| &c.name));
        tables.chain(pictures).map(|name| format!("{}/{name}", self.name)).collect()
    }

    fn runs_of(&self, series: &RawSeries) -> Result<Vec<Run>, String> {
        let part = |name: &String| {
            std::fs::read_to_string(self.folder.join(name))
                .map_err(|e| format!("{name}: cannot read the template: {e}"))
        };
        let text = series.scene.iter().map(part).collect::<Result<Vec<_>, _>>()?.join("\n");
        let plain = Variant { name: String::new(), set: Table::new() };
        let variants = if series.variants.is_empty() { vec![&plain] } else { series.variants.iter().collect() };
        let mut runs = Vec::new();
        for lists in &series.values {
            for parameters in combined(lists)? {
                for variant in &variants {
                    let mut parameters = parameters.clone();
                    if !variant.name.is_empty() {
                        parameters.push(("variant".into(), Value::Text(variant.name.clone())));
                    }
                    runs.push(self.run(series, &text, parameters, &variant.set)?);
                }
            }
        }
        Ok(runs)
    }

    fn run(
        &self,
        series: &RawSeries,
        text: &str,
        parameters: Vec<(String, Value)>,
        variant: &Table,
    ) -> Result<Run, String> {
        Run::new(&series.name, text, &[&series.set, variant], parameters, &self.constants)
    }

    /// Does every expression, series and reference in it exist?
    fn check(&self) -> Result<(), String> {
        for measure in &self.measures {
            expression::evaluate(&measure.expression, &|_| Some(1.0))?;
            if measure.title.contains([',', ' ', '"']) {
                return Err(format!("measure `{}`: its name is a column of results.csv: one word", measure.title));
            }
        }
        let is_series = |name: &String| match self.series.contains(name) {
            true => Ok(()),
            false => Err(format!("there is no series `{name}`")),
        };
        for table in &self.tables {
            let place = |e: String| format!("table {}: {e}", table.name);
            table.series.iter().chain(&table.beside).try_for_each(is_series).map_err(place)?;
            self.check_keys(&table.only).map_err(place)?;
            for column in &table.columns {
                self.probe(&column.expression, table.beside.is_some()).map_err(place)?;
            }
            if table.fit.is_some() && table.mean.is_empty() {
                return Err(place("fit goes with mean, the parameters that are kept apart".into()));
            }
            if table.spread && (table.mean.is_empty() || table.fit.is_some()) {
                return Err(place("spread goes with mean, and not with fit".into()));
            }
            for key in table.mean.iter().chain(&table.fit) {
                let known = key == "series" || self.parameters.contains(key);
                known.then_some(()).ok_or_else(|| place(format!("no parameter `{key}`")))?;
            }
        }
        for picture in &self.pictures {
            let place = |e: String| format!("picture {}: {e}", picture.name);
            for panel in &picture.panels {
                self.probe(&panel.x.expression, false).and(self.probe(&panel.y.expression, false)).map_err(place)?;
                let unknown = panel.references.iter().find(|name| !self.references.iter().any(|r| r.name == **name));
                unknown.map_or(Ok(()), |name| Err(place(format!("no reference `{name}`"))))?;
            }
            for curve in picture.panels.iter().flat_map(|panel| &panel.curves).chain(&picture.curves) {
                curve.series.iter().try_for_each(is_series).map_err(place)?;
                self.check_keys(&curve.only).map_err(place)?;
                curve.y.iter().try_for_each(|y| self.probe(y, false)).map_err(place)?;
            }
        }
        match self.copies.iter().find(|copy| !self.runs.iter().any(|run| run.name == copy.run)) {
            Some(copy) => Err(format!("copy {}: there is no run `{}`", copy.name, copy.run)),
            None => Ok(()),
        }
    }

    fn check_keys(&self, only: &Table) -> Result<(), String> {
        match only.keys().find(|key| !self.parameters.contains(key)) {
            Some(key) => Err(format!("there is no parameter `{key}`")),
            None => Ok(()),
        }
    }

    fn probe(&self, text: &str, beside: bool) -> Result<(), String> {
        let is_known = |name: &str| {
            matches!(name, "particles" | "wall_s" | "series")
                || self.parameters.iter().any(|known| known == name)
                || self.constants.iter().any(|(known, _)| known == name)
                || self.measures.iter().any(|known| known.title == name)
                || self.references.iter().any(|known| known.name == name)
        };
        let lookup = |name: &str| {
            let plain = name.strip_prefix("other.").filter(|_| beside).unwrap_or(name);
            is_known(plain).then_some(1.0)
        };
        expression::evaluate(text, &lookup).map(|_| ())
    }
}

/// Does a run's parameter meet a condition? One it does not have meets none.
fn meets(run: &Run, key: &str, wanted: &toml::Value) -> bool {
    let Some((_, have)) = run.parameters.iter().find(|(name, _)| name == key) else { return false };
    match (wanted, have) {
        (toml::Value::Array(list), Value::Number(have)) => {
            let ends: Vec<f64> = list.iter().filter_map(as_number).collect();
            ends.len() == 2 && ends[0] <= *have && *have <= ends[1]
        }
        (toml::Value::Array(list), Value::Text(have)) => list.iter().any(|text| text.as_str() == Some(have)),
        (wanted, have) => value(wanted).is_ok_and(|wanted| wanted == *have),
    }
}

/// Every combination of the lists, the last one running fastest.
fn combined(lists: &Table) -> Result<Vec<Vec<(String, Value)>>, String> {
    let mut all: Vec<Vec<(String, Value)>> = vec![Vec::new()];
    for (name, list) in lists {
        let list = list.as_array().ok_or_else(|| format!("values.{name} is a list, such as [1, 2]"))?;
        let list = list.iter().map(value).collect::<Result<Vec<_>, _>>()?;
        let with = |run: &Vec<(String, Value)>| {
            let run = run.clone();
            list.iter()
                .map(move |value| [run.clone(), vec![(name.clone(), value.clone())]].concat())
                .collect::<Vec<_>>()
        };
        all = all.iter().flat_map(with).collect();
    }
    Ok(all)
}

fn as_number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
}

/// Number or text of a table.
pub fn value(value: &toml::Value) -> Result<Value, String> {
    match (as_number(value), value.as_str()) {
        (Some(number), _) => Ok(Value::Number(tidy(number))),
        (_, Some(text)) => Ok(Value::Text(text.to_owned())),
        _ => Err(format!("`{value}` is neither number nor text")),
    }
}
