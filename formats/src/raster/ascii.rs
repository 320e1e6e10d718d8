//! ESRI ASCII grids (`.asc`): a header of keys and numbers, then the rows from north to south.

use super::{Grid, MOST_CELLS};

/// The header, each key with its line.
#[derive(Default)]
struct Header {
    keys: Vec<(String, f64, usize)>,
}

impl Header {
    fn get(&self, names: &[&str]) -> Option<(f64, usize)> {
        self.keys.iter().find(|(key, ..)| names.contains(&key.as_str())).map(|&(_, value, line)| (value, line))
    }

    fn needed(&self, names: &[&str]) -> Result<(f64, usize), String> {
        self.get(names).ok_or_else(|| {
            let other = if names.len() > 1 { format!(" (or `{}`)", names[1]) } else { String::new() };
            format!("no ESRI ASCII grid: the header lacks `{}`{other}", names[0])
        })
    }

    fn count(&self, name: &str) -> Result<usize, String> {
        let (value, line) = self.needed(&[name])?;
        if value.fract() != 0.0 || !(1.0..=MOST_CELLS as f64).contains(&value) {
            return Err(format!("line {line}: {name} is {value}; it must be a whole number from 1"));
        }
        Ok(value as usize)
    }
}

/// Keys of the header, in lower case.
const KEYS: [&str; 10] =
    ["ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "dx", "dy", "nodata_value"];

/// Reads a grid.
///
/// # Errors
/// What is wrong, with its line.
pub fn read(bytes: &[u8]) -> Result<Grid, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "neither an ESRI ASCII grid nor a GeoTIFF".to_string())?;
    let mut header = Header::default();
    let mut lines = text.lines().enumerate().map(|(n, line)| (n + 1, line)).peekable();
    while let Some(&(number, line)) = lines.peek() {
        let mut words = line.split_whitespace();
        let first = words.next().unwrap_or_default();
        if !first.is_empty() && first.parse::<f64>().is_ok() {
            break;
        }
        lines.next();
        if first.is_empty() {
            continue;
        }
        let key = first.to_ascii_lowercase();
        if !KEYS.contains(&key.as_str()) {
            return Err(format!("line {number}: no ESRI ASCII grid: `{first}` is no key of its header"));
        }
        let value = words.next().and_then(|word| word.parse::<f64>().ok()).filter(|v| v.is_finite() || key == KEYS[9]);
        let value = value.ok_or_else(|| format!("line {number}: {first} must be followed by a number"))?;
        header.keys.push((key, value, number));
    }

    let size = [header.count("ncols")?, header.count("nrows")?];
    let cells = size[0].checked_mul(size[1]).filter(|&cells| cells <= MOST_CELLS);
    let cells = cells.ok_or_else(|| format!("{} x {} cells are more than {MOST_CELLS}", size[0], size[1]))?;
    let side = |name: &str| {
        let (value, line) = header.get(&["cellsize"]).map_or_else(|| header.needed(&["cellsize", name]), Ok)?;
        if value > 0.0 { Ok(value) } else { Err(format!("line {line}: the size of cells must be greater than 0")) }
    };
    let cell = [side("dx")?, side("dy")?];
    let mut first = [0.0; 2];
    for (axis, name) in ["x", "y"].into_iter().enumerate() {
        let (corner, centre) = (format!("{name}llcorner"), format!("{name}llcenter"));
        first[axis] = match header.get(&[&centre]) {
            Some((value, _)) => value,
            None => header.needed(&[&corner, &centre])?.0 + 0.5 * cell[axis],
        };
    }

    let mut values = Vec::with_capacity(cells);
    let mut last = 0;
    for (number, line) in lines {
        for word in line.split_whitespace() {
            let value: f64 = word.parse().map_err(|_| format!("line {number}: `{word}` is not a number"))?;
            values.push(value);
        }
        last = number;
        if values.len() > cells {
            return Err(format!("line {number}: more values than {} columns x {} rows", size[0], size[1]));
        }
    }
    if values.len() < cells {
        let (found, [nx, ny]) = (values.len(), size);
        return Err(format!("it ends in line {last} with {found} values; {nx} columns x {ny} rows are {cells}"));
    }
    Grid::from_rows(size, first, cell, values, header.get(&["nodata_value"]).map(|(value, _)| value))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: &str = "ncols 3\nNROWS 2\nxllcorner 100.0\nyllcorner 200.0\ncellsize 10\nNODATA_value -9999\n\
                        1 2 3\n4 -9999 6\n";

    fn fault(from: &str, to: &str) -> String {
        assert!(GRID.contains(from));
        read(GRID.replacen(from, to, 1).as_bytes()).unwrap_err()
    }

    #[test]
    fn rows_come_from_the_north() {
        let grid = read(GRID.as_bytes()).unwrap();
        assert_eq!((grid.size, grid.first, grid.cell), ([3, 2], [105.0, 205.0], [10.0; 2]));
        assert_eq!((grid.values[0], grid.values[3], grid.values[5]), (4.0, 1.0, 3.0));
        assert_eq!(grid.missing, [false, true, false, false, false, false]);
        let centred = GRID.replace("corner", "center").replace("cellsize 10", "dx 10\ndy 5");
        let grid = read(centred.as_bytes()).unwrap();
        assert_eq!((grid.first, grid.cell), ([100.0, 200.0], [10.0, 5.0]));
        // Lines may break anywhere.
        let broken = GRID.replace("1 2 3\n4", "1\n2 3 4\n");
        assert_eq!(read(broken.as_bytes()).unwrap().values, read(GRID.as_bytes()).unwrap().values);
    }

    #[test]
    fn faults_name_their_line() {
        assert!(fault("ncols 3\n", "").contains("lacks `ncols`"));
        assert!(fault("ncols 3", "ncols 2.5").contains("line 1: ncols is 2.5"));
        assert!(fault("cellsize 10", "cellsize 0").contains("line 5"));
        assert!(fault("cellsize 10", "cellsize ten").contains("line 5: cellsize must be followed"));
        assert!(fault("cellsize", "cell").contains("`cell` is no key"));
        assert!(fault("yllcorner 200.0\n", "").contains("lacks `yllcorner` (or `yllcenter`)"));
        assert!(fault("4 -9999", "4 x").contains("line 8: `x` is not a number"));
        assert!(fault("4 -9999 6", "4 -9999").contains("it ends in line 8 with 5 values; 3 columns x 2 rows are 6"));
        assert!(fault("-9999 6", "-9999 6 7").contains("line 8: more values"));
        assert!(fault("ncols 3", "ncols 300000000").contains("it must be a whole number"));
        assert!(read(&[0xff, 0xfe, 0]).unwrap_err().contains("neither"));
        assert!(read(b"").unwrap_err().contains("lacks"));
    }
}
