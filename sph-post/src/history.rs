//! The history a run writes: one line per moment, `name [unit]` above every column.

use formats::folder::RunFolder;
use formats::outputs::Index;
use formats::snapshot::FileError;
use std::path::Path;

/// A column of the history.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name, as in the file.
    pub name: String,
    /// Unit, as in the file.
    pub unit: String,
    /// One number a line.
    pub values: Vec<f64>,
}

/// The history of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// The first one is the time.
    pub columns: Vec<Column>,
}

impl History {
    /// The history of the segments in the index. `None` where there is no line yet.
    ///
    /// # Errors
    /// `NotFound`, `CannotRead`; `WrongKind` without a proper first line; `Damaged`, with the line, for all else.
    pub fn read(folder: &RunFolder, index: &Index) -> Result<Option<Self>, FileError> {
        Self::parse(&folder.history(), &index.history(folder)?)
    }

    fn parse(path: &Path, text: &str) -> Result<Option<Self>, FileError> {
        let mut lines = text.lines().enumerate();
        let Some((_, head)) = lines.next() else { return Ok(None) };
        let wrong = |what: String| FileError::WrongKind { path: path.display().to_string(), what };
        let damaged = |line: usize, what: String| {
            let what = format!("line {}: {what}", line + 1);
            FileError::Damaged { path: path.display().to_string(), what }
        };
        let column = |title: &str| {
            let (name, unit) = title.trim().split_once(" [")?;
            Some(Column { name: name.into(), unit: unit.strip_suffix(']')?.into(), values: Vec::new() })
        };
        let columns: Option<Vec<Column>> = head.split(',').map(column).collect();
        let mut columns = columns.filter(|c| c[0].name == "time").ok_or_else(|| {
            wrong(format!("its first line should name columns, `time [s],step [1],..`; it is `{head:.60}`"))
        })?;
        for (number, line) in lines {
            let cells: Vec<&str> = line.split(',').collect();
            if cells.len() != columns.len() {
                return Err(damaged(
                    number,
                    format!("{} numbers where there are {} columns", cells.len(), columns.len()),
                ));
            }
            for (column, cell) in columns.iter_mut().zip(cells) {
                let value = cell.trim().parse().map_err(|_| damaged(number, format!("`{cell}` is not a number")))?;
                column.values.push(value);
            }
            if let [.., before, now] = columns[0].values[..]
                && now <= before
            {
                return Err(damaged(number, format!("time {now:e} s does not come after {before:e} s")));
            }
        }
        Ok((!columns[0].values.is_empty()).then_some(Self { columns }))
    }

    /// Times, s.
    pub fn times(&self) -> &[f64] {
        &self.columns[0].values
    }

    /// A column by its name.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == name).map(|c| &c.values[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Option<History>, FileError> {
        History::parse(Path::new("history.csv"), text)
    }

    #[test]
    fn columns_come_with_names_units_and_the_same_bits() {
        let text = format!("time [s],kinetic_energy [J]\n0e0,{:e}\n1e-3,2.5e0\n", 0.1 + 0.2);
        let h = parse(&text).unwrap().unwrap();
        assert_eq!(h.times(), [0.0, 1e-3]);
        assert_eq!(h.columns[1].unit, "J");
        assert_eq!(h.column("kinetic_energy").unwrap()[0].to_bits(), (0.1_f64 + 0.2).to_bits());
        assert!(h.column("nothing").is_none());
    }

    #[test]
    fn faults_name_their_line() {
        assert_eq!(parse("").unwrap(), None);
        assert_eq!(parse("time [s],step [1]\n").unwrap(), None);
        for (text, say) in [
            ("a,b\n1,2", "first line"),
            ("time [s],a [1]\n1", "line 2"),
            ("time [s],a [1]\n1,2\n2,x", "line 3: `x`"),
            ("time [s],a [1]\n1,2\n1,2", "line 3: time"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(say), "{message}");
        }
    }
}
