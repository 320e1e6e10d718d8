//! Rasters for scenes with a terrain.

use crate::WorkFolder;

/// An ESRI ASCII grid in a work folder: `size` cells with sides `cell`, the south-western corner at `corner`, values by x and y.
pub fn write(
    work: &WorkFolder,
    name: &str,
    size: [i32; 2],
    corner: [f64; 2],
    cell: f64,
    value: impl Fn(f64, f64) -> f64,
) {
    let [nx, ny] = size;
    let mut text =
        format!("ncols {nx}\nnrows {ny}\nxllcorner {}\nyllcorner {}\ncellsize {cell}\n", corner[0], corner[1]);
    for j in (0..ny).rev() {
        let at = |i: i32| [(f64::from(i) + 0.5) * cell + corner[0], (f64::from(j) + 0.5) * cell + corner[1]];
        let row: Vec<String> = (0..nx).map(|i| value(at(i)[0], at(i)[1]).to_string()).collect();
        text += &(row.join(" ") + "\n");
    }
    work.write(name, &text);
}
