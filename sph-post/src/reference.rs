//! Curves that were measured, to be drawn beside those of the run.

use formats::snapshot::FileError;
use std::path::Path;

/// The first line of such a file, after its remarks.
const COLUMNS: &str = "curve,x_m,y_m";

/// Measured curves in m: distance along the profile, height above the floor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reference {
    /// The final surface of the deposit, `free_surface`.
    pub surface: Vec<[f64; 2]>,
    /// The failure line, `failure_line`.
    pub failure: Vec<[f64; 2]>,
}

impl Reference {
    /// From CSV with the columns `curve,x_m,y_m`; lines that begin with # are remarks, other curves are left out.
    ///
    /// # Errors
    /// `CannotRead`, `NotFound`; `WrongKind` for other columns or without a known curve; `Damaged`, with the line, for the rest.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = std::fs::read_to_string(path).map_err(|error| FileError::reading(path, &error))?;
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let wrong = |what: String| FileError::WrongKind { path: path.display().to_string(), what };
        let head = lines.next().map_or("", |(_, line)| line.trim());
        if head != COLUMNS {
            return Err(wrong(format!("its first line should name the columns, `{COLUMNS}`; it is `{head:.60}`")));
        }
        let mut out = Self::default();
        for (number, line) in lines {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let point = match cells[..] {
                [_, x, y] => x.parse().ok().zip(y.parse().ok()).map(|(x, y): (f64, f64)| [x, y]),
                _ => None,
            };
            let point = point.filter(|p| p.iter().all(|v| v.is_finite())).ok_or_else(|| FileError::Damaged {
                path: path.display().to_string(),
                what: format!("line {}: `{line:.60}` should be a curve's name and two numbers", number + 1),
            })?;
            match cells[0] {
                "free_surface" => out.surface.push(point),
                "failure_line" => out.failure.push(point),
                _ => {}
            }
        }
        if out == Self::default() {
            return Err(wrong("it has neither a curve `free_surface` nor one `failure_line`".into()));
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_read_and_faults_name_their_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curves.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Reference::read(&path)
        };
        let head = "# from a paper\ncurve,x_m,y_m\n";
        let r =
            read(&format!("{head}free_surface,0,0.1\nfree_surface,0.1,0.05\nother,1,1\nfailure_line,0.1,0\n")).unwrap();
        assert_eq!(r, Reference { surface: vec![[0.0, 0.1], [0.1, 0.05]], failure: vec![[0.1, 0.0]] });
        for (text, say) in [
            ("x,y\n1,2\n".to_string(), "first line"),
            (format!("{head}free_surface,0\n"), "line 3"),
            (format!("{head}free_surface,0,nan\n"), "line 3"),
            (format!("{head}other,0,1\n"), "neither"),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(say) && message.contains("curves.csv"), "{message}");
        }
        assert!(Reference::read(&folder.path().join("none.csv")).is_err());
    }
}
