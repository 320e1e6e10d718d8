//! Solid bodies from STL files: triangles in text or binary form, their surface checked to be closed.
//!
//! What is nearest to a point, and whether it lies inside, follows from the triangles alone and in f64, so that it is the same on
//! every rank and processor.

mod mesh;
mod nearest;

pub use mesh::Solid;
pub use nearest::Nearest;

/// Three corners, counter-clockwise seen from outside.
pub type Triangle = [[f64; 3]; 3];

/// Bytes before the number of triangles of a binary file, and those of a triangle: 12 numbers in f32, 2 bytes of attributes.
const HEADER: usize = 80;
const RECORD: usize = 50;

/// The triangles of a file, and the spacing of the numbers it is written in at its largest coordinate. What the file says of
/// normals is not used: they follow from the corners.
///
/// # Errors
/// What is wrong with the file, and what would be right.
pub fn read(bytes: &[u8]) -> Result<(Vec<Triangle>, f64), String> {
    let count = bytes.get(HEADER..HEADER + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let length = count.map(|count| HEADER as u64 + 4 + u64::from(count) * RECORD as u64);
    // Headers of binary files may begin with `solid` too: their length is what tells.
    let is_binary = length == Some(bytes.len() as u64);
    let begins = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let is_text = begins && !bytes.contains(&0);
    let triangles = match (is_binary, is_text) {
        (true, _) => binary(&bytes[HEADER + 4..]),
        (false, true) => ascii(&String::from_utf8_lossy(bytes))?,
        (false, false) => {
            let binary = length.map_or(String::new(), |length| {
                format!(", where its {} triangles take {length} in binary form", count.unwrap_or(0))
            });
            return Err(format!("is no STL file: it has {} bytes{binary}, and is no text of a `solid`", bytes.len()));
        }
    };
    if triangles.is_empty() {
        return Err("has no triangles".into());
    }
    let largest = triangles.iter().flatten().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    if !triangles.iter().flatten().flatten().all(|x| x.is_finite()) {
        return Err("has coordinates that are no finite numbers".into());
    }
    let step = if is_binary { f64::from(f32::EPSILON) } else { f64::EPSILON };
    Ok((triangles, largest * step))
}

fn binary(records: &[u8]) -> Vec<Triangle> {
    let number = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let one = |record: &[u8]| [0, 1, 2].map(|corner| [0, 1, 2].map(|a| number(&record[12 + 12 * corner + 4 * a..])));
    records.chunks_exact(RECORD).map(one).collect()
}

fn ascii(text: &str) -> Result<Vec<Triangle>, String> {
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    let mut ended = false;
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        let fault = |what: &str| Err(format!("line {}: {what}", number + 1));
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
                match numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok()) {
                    Some(corner) => corners.push(corner),
                    None => return fault("three numbers are needed after `vertex`"),
                }
            }
            Some("endfacet") => match <[[f64; 3]; 3]>::try_from(std::mem::take(&mut corners)) {
                Ok(triangle) => triangles.push(triangle),
                Err(corners) => return fault(&format!("a facet of {} corners; each must have three", corners.len())),
            },
            Some("solid") => ended = false,
            Some("endsolid") => ended = true,
            Some("facet" | "outer" | "endloop") | None => {}
            Some(other) => return fault(&format!("`{other}` is not known in an STL file")),
        }
    }
    if !ended || !corners.is_empty() {
        return Err("it ends without `endsolid`: part of it is missing".into());
    }
    Ok(triangles)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The twelve triangles of a box.
    pub fn block(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
        let corner = |n: usize| [0, 1, 2].map(|a| if n >> a & 1 == 1 { high[a] } else { low[a] });
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let two = |f: [usize; 4]| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]].map(|t| t.map(corner));
        faces.into_iter().flat_map(two).collect()
    }

    pub fn as_text(triangles: &[Triangle]) -> String {
        let mut text = "solid of a test\n".to_string();
        for t in triangles {
            text += "facet normal 0 0 0\n outer loop\n";
            t.iter().for_each(|[x, y, z]| text += &format!("  vertex {x} {y:e} {z}\n"));
            text += " endloop\nendfacet\n";
        }
        text + "endsolid of a test\n"
    }

    fn as_binary(triangles: &[Triangle]) -> Vec<u8> {
        let mut bytes = b"solid, says this header".to_vec();
        bytes.resize(HEADER, b' ');
        bytes.extend((triangles.len() as u32).to_le_bytes());
        for t in triangles {
            bytes.extend([0; 12]);
            t.iter().flatten().for_each(|&x| bytes.extend((x as f32).to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn text_and_binary_are_read_alike() {
        let triangles = block([-0.5, 0.25, 0.0], [1.0, 2.0, 0.125]);
        let (text, fine) = read(as_text(&triangles).as_bytes()).unwrap();
        let (binary, coarse) = read(&as_binary(&triangles)).unwrap();
        assert_eq!((&text, &binary), (&triangles, &triangles));
        assert!(fine < 1e-15 && (1e-7..1e-6).contains(&coarse));
    }

    #[test]
    fn what_is_no_stl_is_told() {
        let triangles = block([0.0; 3], [1.0; 3]);
        let text = as_text(&triangles);
        let told = |bytes: &[u8]| read(bytes).unwrap_err();
        let half = &text[..=text[..500].rfind('\n').unwrap()];
        assert!(told(half.as_bytes()).contains("without `endsolid`"));
        assert_eq!(
            told(text.replacen("vertex 0 0e0 0", "vertex 0 zero 0", 1).as_bytes()),
            "line 4: three numbers are needed after `vertex`"
        );
        assert!(told(text.replacen("  vertex 0 0e0 0\n", "", 1).as_bytes()).contains("a facet of 2 corners"));
        assert!(told(text.replacen("outer", "inner", 1).as_bytes()).contains("line 3: `inner`"));
        let binary = as_binary(&triangles);
        assert!(
            told(&binary[..200]).contains("200 bytes, where its 12 triangles take 684"),
            "{}",
            told(&binary[..200])
        );
        let mut other = binary.clone();
        other[0] = b'x';
        assert!(told(&other[..600]).contains("its 12 triangles take 684 in"));
        assert_eq!(told(b"solid a\nendsolid a\n"), "has no triangles");
        other[100..104].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(told(&other).contains("finite"));
    }
}
