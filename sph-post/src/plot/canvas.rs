//! Paper, pen and font: everything pictures have in common.
//!
//! A picture is drawn once, as SVG; the PNG is rendered from it with the font that is built in, so that both look
//! alike on any machine, with or without fonts. The PDF, for papers, is the same drawing in vectors with that font inside.

use crate::failure::Failure;
use formats::disk;
use plotters::{
    chart::{ChartBuilder, ChartContext},
    coord::{Shift, cartesian::Cartesian2d, types::RangedCoordf64},
    drawing::{DrawingArea, IntoDrawingArea},
    element::{Circle, PathElement, Rectangle, Text},
    style::{
        Color, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};
use plotters_svg::SVGBackend;
use resvg::{tiny_skia, usvg};
use std::{
    fmt::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Units of the drawing in one pixel of the finished picture: plotters rounds to whole units.
pub const FINE: i32 = 16;

/// Pixels of the PNG for one of the SVG.
const ZOOM: f32 = 2.0;

/// The built-in font: DejaVu Sans, Latin and Greek. Licence: `assets/LICENSE-DejaVu.txt`.
static FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

/// Its name.
const FAMILY: &str = "DejaVu Sans";

/// Text that is no heading, pixels.
pub const SMALL: f64 = 13.0;

/// Dark grey, for text and axes.
pub const INK: RGBColor = RGBColor(40, 40, 40);

/// Light grey, for grid lines.
pub const GRID: RGBColor = RGBColor(228, 228, 228);

/// Colours of curves that are told apart by name; distinct also without full colour vision (Okabe & Ito 2008).
pub const CURVES: [RGBColor; 4] =
    [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];

/// A part of the paper.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A part of the paper with axes.
pub type Axes<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// What drawing may fail with.
pub type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Draws one picture of `size` pixels as `<name>.svg`, `.png` and `.pdf`, and returns their paths.
///
/// # Errors
/// `CannotWrite`, `DiskFull`; `Picture` where the drawing itself fails.
pub fn save(
    folder: &Path,
    name: &str,
    size: [i32; 2],
    draw: impl FnOnce(&Area) -> Drawn,
) -> Result<Vec<PathBuf>, Failure> {
    let paths = ["svg", "png", "pdf"].map(|kind| folder.join(format!("{name}.{kind}")));
    let fault = |what: String| Failure::Picture { path: paths[0].display().to_string(), what };
    let known = plotters::style::register_font(FAMILY, FontStyle::Normal, FONT);
    known.map_err(|_| fault("the built-in font is damaged".into()))?;
    let mut text = String::new();
    {
        let fine = size.map(|s| (s * FINE) as u32);
        let area = SVGBackend::with_string(&mut text, (fine[0], fine[1])).into_drawing_area();
        area.fill(&RGBColor(255, 255, 255)).map_err(|error| fault(error.to_string()))?;
        draw(&area).map_err(|error| fault(error.to_string()))?;
        area.present().map_err(|error| fault(error.to_string()))?;
    }
    let text = finish(&text, size);
    disk::write_atomic(&paths[0], text.as_bytes())?;
    let tree = tree(&text).map_err(fault)?;
    disk::write_atomic(&paths[1], &png(&tree).map_err(fault)?)?;
    disk::write_atomic(&paths[2], &pdf(&tree).map_err(fault)?)?;
    Ok(paths.to_vec())
}

/// Gives the picture its size in pixels, joins rectangles of one colour, and names fonts to fall back on.
fn finish(text: &str, size: [i32; 2]) -> String {
    let mut out = String::with_capacity(text.len() / 2);
    let mut path = String::new();
    let mut colour = String::new();
    let attribute = |line: &str, name: &str| -> Option<String> {
        let begin = line.find(&format!(" {name}=\""))? + name.len() + 3;
        Some(line[begin..].split('"').next()?.to_string())
    };
    let close = |out: &mut String, path: &mut String, colour: &str| {
        if !path.is_empty() {
            let _ = writeln!(out, "<path fill=\"{colour}\" d=\"{path}\"/>");
            path.clear();
        }
    };
    for line in text.lines() {
        let filled = line.starts_with("<rect") && line.contains("stroke=\"none\"") && line.contains("opacity=\"1\"");
        let parts: Option<Vec<String>> =
            ["x", "y", "width", "height", "fill"].iter().map(|n| attribute(line, n)).collect();
        match parts {
            Some(parts) if filled => {
                if parts[4] != colour {
                    close(&mut out, &mut path, &colour);
                    colour.clone_from(&parts[4]);
                }
                let [x, y, w, h] = [&parts[0], &parts[1], &parts[2], &parts[3]];
                let _ = write!(path, "M{x} {y}h{w}v{h}h-{w}z");
            }
            _ => {
                close(&mut out, &mut path, &colour);
                let wide = format!("<svg width=\"{}\" height=\"{}\"", size[0] * FINE, size[1] * FINE);
                let narrow = format!("<svg width=\"{}\" height=\"{}\"", size[0], size[1]);
                // Verdana is as wide as DejaVu Sans: labels fit where neither the one nor the other is there.
                let fonts = format!("font-family=\"{FAMILY}, Verdana, sans-serif\"");
                let line = line.replace(&wide, &narrow).replace(&format!("font-family=\"{FAMILY}\""), &fonts);
                out.push_str(&line);
                out.push('\n');
            }
        }
    }
    out
}

/// The picture as a tree of shapes and text in the built-in font.
fn tree(text: &str) -> Result<usvg::Tree, String> {
    let mut options = usvg::Options { font_family: FAMILY.into(), ..usvg::Options::default() };
    let fonts = Arc::make_mut(&mut options.fontdb);
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family(FAMILY);
    usvg::Tree::from_str(text, &options).map_err(|error| error.to_string())
}

/// As PDF, a point for a pixel of the SVG.
fn pdf(tree: &usvg::Tree) -> Result<Vec<u8>, String> {
    let converted = svg2pdf::to_pdf(tree, svg2pdf::ConversionOptions::default(), svg2pdf::PageOptions::default());
    converted.map_err(|error| error.to_string())
}

/// As PNG.
fn png(tree: &usvg::Tree) -> Result<Vec<u8>, String> {
    let size = tree.size().to_int_size().scale_by(ZOOM).ok_or("it has no size")?;
    let mut pixels = tiny_skia::Pixmap::new(size.width(), size.height()).ok_or("it is too large")?;
    resvg::render(tree, tiny_skia::Transform::from_scale(ZOOM, ZOOM), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}

/// Viridis, at `part` of its way from dark blue (0) to yellow (1).
pub fn viridis(part: f64) -> RGBColor {
    const STOPS: [[u8; 3]; 9] = [
        [68, 1, 84],
        [71, 45, 123],
        [59, 82, 139],
        [44, 114, 142],
        [33, 145, 140],
        [40, 174, 128],
        [94, 201, 98],
        [173, 220, 48],
        [253, 231, 37],
    ];
    let at = if part.is_finite() { part.clamp(0.0, 1.0) * 8.0 } else { 0.0 };
    let (k, rest) = ((at.floor() as usize).min(7), at - at.floor().min(7.0));
    let mix = |c: usize| (f64::from(STOPS[k][c]) * (1.0 - rest) + f64::from(STOPS[k + 1][c]) * rest).round() as u8;
    RGBColor(mix(0), mix(1), mix(2))
}

/// Text of `size` pixels, anchored at `pos`.
pub fn style(size: f64, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    let font = (FAMILY, size * f64::from(FINE) * 1.24).into_font();
    TextStyle::from(font).color(&INK).pos(Pos::new(horizontal, vertical))
}

/// A line `width` pixels wide.
pub fn pen(colour: RGBColor, width: f64) -> ShapeStyle {
    ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: (width * f64::from(FINE)).round() as u32 }
}

/// A place on an area in pixels, as plotters wants it.
pub fn place(x: f64, y: f64) -> (i32, i32) {
    ((x * f64::from(FINE)).round() as i32, (y * f64::from(FINE)).round() as i32)
}

/// Writes `text` at a place in pixels.
pub fn write(area: &Area, text: &str, x: f64, y: f64, style: TextStyle<'static>) -> Drawn {
    Ok(area.draw(&Text::new(text.to_string(), place(x, y), style))?)
}

/// Writes what a picture shows along its upper edge, smaller where it would not fit.
pub fn headline(area: &Area, text: &str) -> Drawn {
    let room = f64::from(area.dim_in_pixel().0) / f64::from(FINE) - 20.0;
    // A letter of this font is 0.56 of its size wide, in the mean.
    let fits = room / (0.56 * text.chars().count().max(1) as f64);
    write(area, text, 12.0, 8.0, style(fits.clamp(8.0, 15.0), HPos::Left, VPos::Top))
}

/// Part of an area: left, top, right and bottom in pixels.
pub fn part<'a>(area: &Area<'a>, [left, top, right, bottom]: [f64; 4]) -> Area<'a> {
    let (a, b) = (place(left, top), place(right, bottom));
    area.clone().shrink(a, ((b.0 - a.0).max(1), (b.1 - a.1).max(1)))
}

/// Round numbers that divide a range into about `wanted` parts.
pub fn ticks(low: f64, high: f64, wanted: usize) -> Vec<f64> {
    let rough = (high - low) / wanted.max(1) as f64;
    if !(rough > 0.0 && rough.is_finite()) {
        return vec![low];
    }
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].into_iter().map(|s| s * power).find(|s| *s >= rough * 0.999).unwrap_or(power);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|k| k as f64 * step).collect()
}

/// A number without needless digits.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let size = value.abs();
    if !(1e-4..1e5).contains(&size) {
        return format!("{value:.1e}").replace('-', "\u{2212}");
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, 7) as usize;
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.replace('-', "\u{2212}")
}

/// Ranges and names of a pair of axes.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Range along x.
    pub x: [f64; 2],
    /// Range along y.
    pub y: [f64; 2],
    /// Name of x; no numbers either where there is none.
    pub x_name: Option<String>,
    /// Name of y; no numbers either where there is none.
    pub y_name: Option<String>,
}

/// Room for the numbers and the name of an axis, pixels: left of it, below it.
pub const MARGIN: [f64; 2] = [70.0, 46.0];

/// Draws axes around `inner` (left, top, right, bottom in pixels on `area`), with grid, numbers and names outside.
pub fn axes<'a>(area: &Area<'a>, inner: [f64; 4], frame: &Frame) -> Result<Axes<'a>, Box<dyn std::error::Error>> {
    let [left, top, right, bottom] = inner;
    let chart =
        ChartBuilder::on(&part(area, inner)).build_cartesian_2d(frame.x[0]..frame.x[1], frame.y[0]..frame.y[1])?;
    let line = |a: (f64, f64), b: (f64, f64), colour, width| {
        area.draw(&PathElement::new(vec![place(a.0, a.1), place(b.0, b.1)], pen(colour, width)))
    };
    let at = |v: f64, range: [f64; 2], low: f64, high: f64| low + (v - range[0]) / (range[1] - range[0]) * (high - low);
    for v in ticks(frame.x[0], frame.x[1], ((right - left) / 90.0).round().max(2.0) as usize) {
        let x = at(v, frame.x, left, right);
        line((x, top), (x, bottom), GRID, 0.8)?;
        line((x, bottom), (x, bottom + 4.0), INK, 1.0)?;
        if frame.x_name.is_some() {
            write(area, &number(v), x, bottom + 7.0, style(SMALL, HPos::Center, VPos::Top))?;
        }
    }
    for v in ticks(frame.y[0], frame.y[1], ((bottom - top) / 50.0).round().max(2.0) as usize) {
        let y = at(v, frame.y, bottom, top);
        line((left, y), (right, y), GRID, 0.8)?;
        line((left - 4.0, y), (left, y), INK, 1.0)?;
        if frame.y_name.is_some() {
            write(area, &number(v), left - 7.0, y, style(SMALL, HPos::Right, VPos::Center))?;
        }
    }
    let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
    area.draw(&PathElement::new(corners.map(|c| place(c.0, c.1)).to_vec(), pen(INK, 1.0)))?;
    if let Some(name) = &frame.x_name {
        write(area, name, 0.5 * (left + right), bottom + 26.0, style(SMALL, HPos::Center, VPos::Top))?;
    }
    if let Some(name) = &frame.y_name {
        let turned = style(SMALL, HPos::Center, VPos::Top).transform(plotters::style::FontTransform::Rotate270);
        write(area, name, left - MARGIN[0] + 4.0, 0.5 * (top + bottom), turned)?;
    }
    Ok(chart)
}

/// A vertical colour bar from 0 to `high`, 14 pixels wide, with its name above.
pub fn colour_bar(area: &Area, x: f64, [top, bottom]: [f64; 2], range: [f64; 2], name: &str) -> Drawn {
    const STEPS: i32 = 64;
    for k in 0..STEPS {
        let y = |k: i32| bottom + (top - bottom) * f64::from(k) / f64::from(STEPS);
        let colour = viridis((f64::from(k) + 0.5) / f64::from(STEPS)).filled();
        // A little overlap: no hairlines between the steps.
        area.draw(&Rectangle::new([place(x, y(k + 1)), place(x + 14.0, (y(k) + 0.5).min(bottom))], colour))?;
    }
    let corners = [(x, top), (x + 14.0, top), (x + 14.0, bottom), (x, bottom), (x, top)];
    area.draw(&PathElement::new(corners.map(|c| place(c.0, c.1)).to_vec(), pen(INK, 0.8)))?;
    for v in ticks(range[0], range[1], ((bottom - top) / 40.0).round().max(2.0) as usize) {
        let y = bottom + (top - bottom) * (v - range[0]) / (range[1] - range[0]);
        area.draw(&PathElement::new(vec![place(x + 14.0, y), place(x + 18.0, y)], pen(INK, 0.8)))?;
        write(area, &number(v), x + 21.0, y, style(SMALL, HPos::Left, VPos::Center))?;
    }
    write(area, name, x, top - 8.0, style(SMALL, HPos::Left, VPos::Bottom))
}

/// One line of a legend.
pub struct Entry<'a> {
    /// What it says.
    pub text: &'a str,
    /// Colour of the line beside it.
    pub colour: RGBColor,
    /// Dashed?
    pub dashed: bool,
}

/// Lines and what they mean, from (x, y) downward.
pub fn legend(area: &Area, x: f64, y: f64, entries: &[Entry]) -> Drawn {
    for (k, entry) in entries.iter().enumerate() {
        let y = y + 20.0 * k as f64;
        for (a, b) in if entry.dashed { vec![(0.0, 9.0), (15.0, 24.0)] } else { vec![(0.0, 24.0)] } {
            area.draw(&PathElement::new(vec![place(x + a, y), place(x + b, y)], pen(entry.colour, 2.0)))?;
        }
        write(area, entry.text, x + 31.0, y, style(SMALL, HPos::Left, VPos::Center))?;
    }
    Ok(())
}

/// A line through places in pixels, in dashes of 9 pixels with gaps of 6 if so wanted.
pub fn polyline(area: &Area, points: &[(f64, f64)], style: ShapeStyle, dashed: bool) -> Drawn {
    if points.len() < 2 {
        return Ok(());
    }
    if !dashed {
        return Ok(area.draw(&PathElement::new(points.iter().map(|p| place(p.0, p.1)).collect::<Vec<_>>(), style))?);
    }
    let mut gone = 0.0;
    for ends in points.windows(2) {
        let (a, b) = (ends[0], ends[1]);
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        let at = |t: f64| place(a.0 + (b.0 - a.0) * t / length, a.1 + (b.1 - a.1) * t / length);
        let mut begin = -(gone % 15.0);
        while begin < length {
            let (from, to) = (begin.max(0.0), (begin + 9.0).min(length));
            if to > from {
                area.draw(&PathElement::new(vec![at(from), at(to)], style))?;
            }
            begin += 15.0;
        }
        gone += length;
    }
    Ok(())
}

/// Colours and what they mean, as filled squares, from (x, y) downward.
pub fn swatches(area: &Area, x: f64, y: f64, entries: &[(RGBColor, String)]) -> Drawn {
    for (k, (colour, text)) in entries.iter().enumerate() {
        let y = y + 20.0 * k as f64;
        area.draw(&Rectangle::new([place(x, y - 6.5), place(x + 13.0, y + 6.5)], colour.filled()))?;
        write(area, text, x + 20.0, y, style(SMALL, HPos::Left, VPos::Center))?;
    }
    Ok(())
}

/// A curve through the points with finite coordinates.
pub fn curve(chart: &mut Axes, points: &[(f64, f64)], style: ShapeStyle) -> Drawn {
    let finite: Vec<(f64, f64)> = points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
    chart.draw_series([PathElement::new(finite, style)])?;
    Ok(())
}

/// Measured points: small circles, seen on curves and on white.
pub fn marks(chart: &mut Axes, points: &[(f64, f64)]) -> Drawn {
    let radius = 3 * FINE + FINE / 2;
    let white = RGBColor(255, 255, 255).filled();
    chart.draw_series(points.iter().map(|p| Circle::new(*p, radius, white)))?;
    chart.draw_series(points.iter().map(|p| Circle::new(*p, radius, pen(INK, 1.4))))?;
    Ok(())
}

/// What such a point means, beside one, at a place in pixels.
pub fn mark_legend(area: &Area, [x, y]: [f64; 2], text: &str) -> Drawn {
    area.draw(&Circle::new(place(x + 12.0, y), 3 * FINE + FINE / 2, pen(INK, 1.4)))?;
    write(area, text, x + 31.0, y, style(SMALL, HPos::Left, VPos::Center))
}

/// A dashed straight line between two points of the chart that is parallel to an axis.
pub fn dashed(chart: &mut Axes, from: (f64, f64), to: (f64, f64), colour: RGBColor) -> Drawn {
    let ends = [from, to].map(|p| chart.backend_coord(&p));
    let long = (ends[1].0 - ends[0].0).abs().max((ends[1].1 - ends[0].1).abs());
    // Fifteen pixels each, nine of them drawn.
    let dashes = (long / (15 * FINE)).max(1);
    let at = |k: f64| (from.0 + (to.0 - from.0) * k, from.1 + (to.1 - from.1) * k);
    let piece = |k: i32| {
        let ends = [f64::from(k), f64::from(k) + 0.6].map(|k| at(k / f64::from(dashes)));
        PathElement::new(ends.to_vec(), pen(colour, 1.6))
    };
    chart.draw_series((0..dashes).map(piece))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 1.0, 5), [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert_eq!(ticks(-1.0, 1.0, 2), [-1.0, 0.0, 1.0]);
        assert_eq!(ticks(3.0, 3.0, 4), [3.0]);
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.6000000000000001, "0.6"),
            (-1.5, "−1.5"),
            (2500.0, "2500"),
            (1e-7, "1.0e−7"),
            (120.0, "120"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn viridis_grows_lighter() {
        let light = |part: f64| {
            let RGBColor(r, g, b) = viridis(part);
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        assert!((0..100).all(|k| light(f64::from(k) / 100.0) < light(f64::from(k + 1) / 100.0) + 0.5));
        assert_eq!(viridis(f64::NAN), viridis(0.0));
    }

    #[test]
    fn equal_rectangles_become_one_path() {
        let rect = |x: i32, c: &str| {
            format!("<rect x=\"{x}\" y=\"2\" width=\"3\" height=\"4\" opacity=\"1\" fill=\"{c}\" stroke=\"none\"/>\n")
        };
        let text = format!(
            "<svg width=\"160\" height=\"160\" viewBox=\"0 0 160 160\">\n{}{}{}</svg>\n",
            rect(1, "#0"),
            rect(5, "#0"),
            rect(9, "#1")
        );
        let out = finish(&text, [10, 10]);
        assert_eq!(out.matches("<path").count(), 2, "{out}");
        assert!(out.starts_with("<svg width=\"10\" height=\"10\" viewBox=\"0 0 160 160\">"), "{out}");
        assert!(out.contains("M1 2h3v4h-3zM5 2h3v4h-3z"), "{out}");
    }
}
