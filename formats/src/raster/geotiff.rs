//! GeoTIFF: one band of numbers, with the place of a pixel (`ModelTiepoint`), the size of pixels (`ModelPixelScale`) and the
//! code of the coordinate reference system (GeoTIFF 1.1, OGC 19-008).

use super::{Grid, MOST_CELLS};
use std::io::Cursor;
use tiff::{
    decoder::{Decoder, DecodingResult, Limits},
    tags::Tag,
};

/// GTRasterTypeGeoKey; its value where pixels are points.
const RASTER_TYPE: u16 = 1025;
const PIXEL_IS_POINT: u16 = 2;
/// ProjectedCRSGeoKey and GeodeticCRSGeoKey: EPSG codes.
const CRS: [u16; 2] = [3072, 2048];
/// Codes from here on are the user's own.
const USER_DEFINED: u16 = 32767;

/// Reads a grid.
///
/// # Errors
/// What is wrong.
pub fn read(bytes: &[u8]) -> Result<Grid, String> {
    let no = |error: tiff::TiffError| format!("this GeoTIFF cannot be read: {error}");
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 8 * MOST_CELLS;
    let mut file = Decoder::new(Cursor::new(bytes)).map_err(no)?.with_limits(limits);
    let (columns, rows) = file.dimensions().map_err(no)?;
    let size = [columns as usize, rows as usize];
    let scale = file.find_tag(Tag::ModelPixelScaleTag).map_err(no)?.and_then(|v| v.into_f64_vec().ok());
    let tie = file.find_tag(Tag::ModelTiepointTag).map_err(no)?.and_then(|v| v.into_f64_vec().ok());
    let (Some([dx, dy, ..]), Some(&[i, j, _, x, y, _])) = (scale.as_deref(), tie.as_deref()) else {
        let needed = "a ModelPixelScale and one ModelTiepoint (a raster that is not rotated)";
        return Err(format!("this TIFF lacks {needed}; write it anew, for example with gdal_translate"));
    };
    let cell = [*dx, *dy];
    if !cell.iter().all(|&side| side > 0.0 && side.is_finite()) {
        return Err(format!("its pixels have sides of {dx} and {dy}; both must be greater than 0"));
    }
    let keys = file.find_tag(Tag::GeoKeyDirectoryTag).map_err(no)?.and_then(|v| v.into_u16_vec().ok());
    let key = |wanted: u16| {
        let entry = keys.as_deref()?.get(4..)?.chunks_exact(4).find(|entry| entry[0] == wanted && entry[1] == 0)?;
        Some(entry[3])
    };
    let code = CRS.into_iter().filter_map(key).find(|&code| code > 0 && code < USER_DEFINED);
    // The tie point is the corner of its pixel, or its middle where pixels are points.
    let half = if key(RASTER_TYPE) == Some(PIXEL_IS_POINT) { 0.0 } else { 0.5 };
    let north = y + (j - half) * dy;
    let first = [x + (half - i) * dx, north - (rows as f64 - 1.0) * dy];
    let no_data = file.find_tag(Tag::GdalNodata).map_err(no)?.and_then(|v| v.into_string().ok());
    let no_data = no_data.and_then(|text| text.trim_end_matches('\0').trim().parse::<f64>().ok());
    let values: Vec<f64> = match file.read_image().map_err(no)? {
        DecodingResult::F32(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::F64(v) => v,
        DecodingResult::I8(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::I16(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::I32(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::U8(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::U16(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::U32(v) => v.into_iter().map(f64::from).collect(),
        _ => {
            return Err(
                "its numbers are of a kind that is not read; write it with f32 (gdal_translate -ot Float32)".into()
            );
        }
    };
    if values.len() != size[0] * size[1] {
        let bands = values.len() / (size[0] * size[1]).max(1);
        return Err(format!("it has {bands} bands; one is needed (gdal_translate -b 1)"));
    }
    // The mark for no data is written in decimal, values of 32 bits are not.
    let rounded = no_data.map(|mark| if values.contains(&mark) { mark } else { f64::from(mark as f32) });
    let mut grid = Grid::from_rows(size, first, cell, values, rounded)?;
    grid.crs = code.map(|code| format!("EPSG:{code}"));
    Ok(grid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiff::encoder::{TiffEncoder, colortype};

    /// 3 x 2 pixels of 10 m, the corner of the north-western one at (100, 220).
    fn file(point: bool, with_place: bool) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        let mut image = encoder.new_image::<colortype::Gray32Float>(3, 2).unwrap();
        let tags = image.encoder();
        if with_place {
            tags.write_tag(Tag::ModelPixelScaleTag, &[10.0_f64, 10.0, 0.0][..]).unwrap();
            tags.write_tag(Tag::ModelTiepointTag, &[0.0_f64, 0.0, 0.0, 100.0, 220.0, 0.0][..]).unwrap();
        }
        let kind = if point { 2 } else { 1 };
        let keys = [1_u16, 1, 0, 2, RASTER_TYPE, 0, 1, kind, CRS[0], 0, 1, 32632];
        tags.write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).unwrap();
        tags.write_tag(Tag::GdalNodata, "-9999.1").unwrap();
        image.write_data(&[1.0_f32, 2.0, 3.0, 4.0, -9999.1, 6.0]).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn it_says_the_same_as_an_ascii_grid() {
        let grid = Grid::read(&file(false, true)).unwrap();
        let text = "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\nnodata_value -1\n1 2 3\n4 -1 6\n";
        let ascii = Grid::read(text.as_bytes()).unwrap();
        assert_eq!(grid.crs.as_deref(), Some("EPSG:32632"));
        assert_eq!(Grid { crs: None, ..grid }, ascii);
        assert_eq!(Grid::read(&file(true, true)).unwrap().first, [100.0, 210.0]);
    }

    #[test]
    fn a_plain_picture_is_refused() {
        assert!(Grid::read(&file(false, false)).unwrap_err().contains("lacks a ModelPixelScale"));
        let whole = file(false, true);
        assert!(Grid::read(&whole[..20]).unwrap_err().contains("cannot be read"));
    }
}
