//! Result files: flat NetCDF-4 that follows the CF conventions, as xarray and ParaView read them.
//!
//! This module knows the container; what the variables mean is said by whoever fills a [`Dataset`].

use crate::{disk, snapshot::FileError};
use std::path::Path;

/// Stands for "no value here" on disk; in memory that is NaN. It is NetCDF's own default for doubles.
pub const FILL: f64 = 9.969_209_968_386_869e36;

/// Conventions the files follow.
pub const CONVENTIONS: &str = "CF-1.11";

/// The dimension along which files of one run are joined.
pub const TIME: &str = "t";

/// Value of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// UTF-8 text.
    Text(String),
    /// f64.
    Number(f64),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}
impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}
impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

/// What a variable is for: only data can be missing, so only data carry a fill value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Coordinates and the bounds of their cells.
    Coordinate,
    /// Everything else.
    Data,
}

/// A variable of f64.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name: a letter, then letters, digits and underscores.
    pub name: String,
    /// Coordinate or data.
    pub role: Role,
    /// Names of its dimensions, slowest first; none for a single number.
    pub dimensions: Vec<String>,
    /// `long_name`, `units` and so on.
    pub attributes: Vec<(String, Value)>,
    /// Row-major; NaN where data have no value.
    pub values: Vec<f64>,
}

impl Variable {
    /// A variable with the two attributes every one must have. `unit` as CF writes it: `m s-1`, `1`.
    pub fn new(name: &str, role: Role, dimensions: &[&str], long_name: &str, unit: &str, values: Vec<f64>) -> Self {
        let attributes = vec![("long_name".into(), long_name.into()), ("units".into(), unit.into())];
        let dimensions = dimensions.iter().map(|&d| d.into()).collect();
        Self { name: name.into(), role, dimensions, attributes, values }
    }

    /// The same variable with one more attribute.
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.attributes.push((name.into(), value.into()));
        self
    }
}

/// A whole file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dataset {
    /// Global attributes; `Conventions` is added by [`Dataset::write`].
    pub attributes: Vec<(String, Value)>,
    /// Name and length of every dimension.
    pub dimensions: Vec<(String, usize)>,
    /// Variables; those over [`TIME`] have it as their first dimension.
    pub variables: Vec<Variable>,
    /// Chunk length along [`TIME`], the same for every variable: xarray refuses files where it differs.
    pub time_chunk: usize,
}

impl Dataset {
    /// Adds a global attribute.
    pub fn attribute(&mut self, name: &str, value: impl Into<Value>) {
        self.attributes.push((name.into(), value.into()));
    }

    /// Adds a dimension.
    pub fn dimension(&mut self, name: &str, length: usize) {
        self.dimensions.push((name.into(), length));
    }

    /// Adds a variable.
    pub fn variable(&mut self, variable: Variable) {
        self.variables.push(variable);
    }

    /// Writes the file whole or not at all. Serial.
    ///
    /// # Errors
    /// `CannotWrite`, `DiskFull`; also `CannotWrite` where a variable's length does not match its dimensions.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let temporary = disk::temporary(path);
        // NetCDF hides the system's reason behind "HDF error": let the system say it first.
        std::fs::File::create(&temporary).map_err(|error| FileError::writing(path, 0, &error))?;
        let written = self.fill(&temporary).map_err(|error| {
            let size: usize = self.variables.iter().map(|v| 8 * v.values.len()).sum();
            // Ask the system again whether there was room: NetCDF does not tell.
            let probe = std::fs::write(&temporary, vec![0; size.min(1 << 20)]);
            match probe {
                Err(system) => FileError::writing(path, size as u64, &system),
                Ok(()) => FileError::cannot_write(path, error),
            }
        });
        if let Err(error) = written {
            let _ = std::fs::remove_file(&temporary);
            return Err(error);
        }
        disk::sync_file(&temporary)?;
        disk::publish(&temporary, path)
    }

    fn fill(&self, path: &Path) -> netcdf::Result<()> {
        let mut file = netcdf::create(path)?;
        file.add_attribute("Conventions", CONVENTIONS)?;
        for (name, value) in &self.attributes {
            match value {
                Value::Text(text) => file.add_attribute(name, text.as_str())?,
                Value::Number(number) => file.add_attribute(name, *number)?,
            };
        }
        for (name, length) in &self.dimensions {
            file.add_dimension(name, *length)?;
        }
        for variable in &self.variables {
            self.put(&mut file, variable)?;
        }
        file.close()
    }

    fn put(&self, file: &mut netcdf::FileMut, variable: &Variable) -> netcdf::Result<()> {
        let shape = self.shape(variable)?;
        let names: Vec<&str> = variable.dimensions.iter().map(String::as_str).collect();
        let mut out = file.add_variable::<f64>(&variable.name, &names)?;
        if !shape.is_empty() {
            out.set_chunking(&self.chunks(variable, &shape))?;
            out.set_compression(4, true)?;
        }
        if variable.role == Role::Data {
            out.set_fill_value(FILL)?;
        }
        for (name, value) in &variable.attributes {
            match value {
                Value::Text(text) => out.put_attribute(name, text.as_str())?,
                Value::Number(number) => out.put_attribute(name, *number)?,
            };
        }
        let values: Vec<f64> = variable.values.iter().map(|&v| if v.is_finite() { v } else { FILL }).collect();
        out.put_values(&values, ..)
    }

    /// Lengths of a variable's dimensions, which must agree with the number of its values.
    fn shape(&self, variable: &Variable) -> netcdf::Result<Vec<usize>> {
        let length = |name: &String| {
            let found = self.dimensions.iter().find(|(n, _)| n == name).map(|(_, length)| *length);
            found.ok_or_else(|| netcdf::Error::Str(format!("{}: no dimension {name}", variable.name)))
        };
        let shape = variable.dimensions.iter().map(length).collect::<netcdf::Result<Vec<_>>>()?;
        let wanted: usize = shape.iter().product();
        if wanted != variable.values.len() || wanted == 0 {
            let (name, got) = (&variable.name, variable.values.len());
            return Err(netcdf::Error::Str(format!("{name}: {got} values for dimensions of {wanted}")));
        }
        Ok(shape)
    }

    fn chunks(&self, variable: &Variable, shape: &[usize]) -> Vec<usize> {
        let longest = if shape.len() > 2 { 512 } else { 1 << 16 };
        let chunk = |(name, &length): (&String, &usize)| {
            let wanted = if name == TIME { self.time_chunk } else { longest };
            length.min(wanted).max(1)
        };
        variable.dimensions.iter().zip(shape).map(chunk).collect()
    }
}

/// Reads one variable of a result file, row-major, NaN where it has no value. Serial.
///
/// # Errors
/// `NotFound`, `CannotRead`; `WrongKind` where the file is no NetCDF file or has no such variable.
pub fn read(path: &Path, name: &str) -> Result<Vec<f64>, FileError> {
    let file = open(path)?;
    let variable =
        file.variable(name).ok_or_else(|| FileError::wrong_kind(path, format!("it has no variable {name}")))?;
    let values = variable.get_values::<f64, _>(..).map_err(|error| FileError::damaged(path, error))?;
    Ok(values.into_iter().map(|v| if v == FILL { f64::NAN } else { v }).collect())
}

fn open(path: &Path) -> Result<netcdf::File, FileError> {
    std::fs::File::open(path).map_err(|error| FileError::reading(path, &error))?;
    netcdf::open(path).map_err(|error| FileError::wrong_kind(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Dataset {
        let mut d = Dataset { time_chunk: 1, ..Dataset::default() };
        d.attribute("title", "sample");
        d.attribute("spacing", 0.25);
        d.dimension("t", 2);
        d.dimension("x", 3);
        d.variable(Variable::new("t", Role::Coordinate, &["t"], "time", "s", vec![0.0, 0.1]));
        d.variable(Variable::new("x", Role::Coordinate, &["x"], "place", "m", vec![1.0, 2.0, 3.0]));
        let values = vec![1.0, f64::NAN, 1e-300, -2.5, 0.1 + 0.2, 6.0];
        d.variable(Variable::new("height", Role::Data, &["t", "x"], "height", "m", values));
        d.variable(Variable::new("r0", Role::Data, &[], "radius", "m", vec![0.1]).with("comment", "one number"));
        d
    }

    #[test]
    fn numbers_come_back_with_the_same_bits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.nc");
        sample().write(&path).unwrap();
        let height = read(&path, "height").unwrap();
        assert_eq!(height[4].to_bits(), (0.1_f64 + 0.2).to_bits());
        assert!(height[1].is_nan());
        assert_eq!(read(&path, "r0").unwrap(), [0.1]);
        let attribute = |name| open(&path).unwrap().attribute(name).unwrap().value().unwrap();
        assert_eq!(attribute("Conventions"), netcdf::AttributeValue::Str(CONVENTIONS.into()));
        assert_eq!(attribute("spacing"), netcdf::AttributeValue::Double(0.25));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn wrong_shapes_and_places_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut wrong = sample();
        wrong.variables[2].values.pop();
        let error = wrong.write(&folder.path().join("b.nc")).unwrap_err();
        assert!(error.to_string().contains("5 values for dimensions of 6"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let error = sample().write(&folder.path().join("none/b.nc")).unwrap_err();
        assert_eq!(error.exit_code(), crate::exit::CANNOT_WRITE);
        let text = folder.path().join("text.nc");
        std::fs::write(&text, "no").unwrap();
        assert_eq!(read(&text, "t").unwrap_err().exit_code(), crate::exit::NO_INPUT);
        assert!(matches!(read(&folder.path().join("nil.nc"), "t"), Err(FileError::NotFound { .. })));
    }
}
