//! Paper and pen: a picture is written as SVG, and rendered with the font that is built in, so that it is the same to the
//! bit on any machine.

use resvg::{tiny_skia, usvg};
use std::fmt::Write as _;
use std::sync::Arc;

/// DejaVu Sans, Latin and Greek, as in the pictures of `sph-post`.
static FONT: &[u8] = include_bytes!("../../../sph-post/assets/DejaVuSans-subset.ttf");
const FAMILY: &str = "DejaVu Sans";

/// Pixels of the PNG for one of the drawing.
const ZOOM: f32 = 2.0;

/// Colours that the colour-blind can tell apart (Okabe & Ito 2008).
pub const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#777777"];

/// Text and axes.
pub const INK: &str = "#222222";
/// Lines across.
pub const GRID: &str = "#dddddd";

/// Where text is anchored.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

/// A drawing of a size in pixels.
pub struct Paper {
    body: String,
    size: [f64; 2],
}

impl Paper {
    /// White.
    pub fn new(size: [f64; 2]) -> Self {
        Self { body: String::new(), size }
    }

    /// Through points; `dash` as in SVG, empty for a whole line.
    pub fn line(&mut self, points: &[[f64; 2]], colour: &str, width: f64, dash: &str) {
        let list: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            self.body,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-dasharray=\"{}\"/>",
            list.join(" "),
            if dash.is_empty() { "none" } else { dash },
        );
    }

    /// A marker; shapes differ, for those who cannot tell the colours.
    pub fn marker(&mut self, at: [f64; 2], shape: usize, colour: &str) {
        self.shape(at, shape, &format!("fill=\"{colour}\""));
    }

    /// The same, white inside.
    pub fn hollow(&mut self, at: [f64; 2], shape: usize, colour: &str) {
        self.shape(at, shape, &format!("fill=\"white\" stroke=\"{colour}\" stroke-width=\"1.6\""));
    }

    fn shape(&mut self, [x, y]: [f64; 2], shape: usize, look: &str) {
        let corners: &[[f64; 2]] = match shape % 5 {
            0 => {
                let _ = writeln!(self.body, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" {look}/>");
                return;
            }
            1 => &[[-3.6, -3.6], [3.6, -3.6], [3.6, 3.6], [-3.6, 3.6]],
            2 => &[[0.0, -5.0], [4.6, 3.4], [-4.6, 3.4]],
            3 => &[[0.0, -5.2], [5.2, 0.0], [0.0, 5.2], [-5.2, 0.0]],
            _ => &[[0.0, 5.0], [4.6, -3.4], [-4.6, -3.4]],
        };
        let list: Vec<String> = corners.iter().map(|[a, b]| format!("{:.1},{:.1}", x + a, y + b)).collect();
        let _ = writeln!(self.body, "<polygon points=\"{}\" {look}/>", list.join(" "));
    }

    /// Text at a place, its middle at that height.
    pub fn text(&mut self, text: &str, [x, y]: [f64; 2], anchor: Anchor) {
        self.write(text, &format!("x=\"{x:.1}\" y=\"{:.1}\"", y + 4.5), anchor);
    }

    /// Text that reads upward.
    pub fn upward(&mut self, text: &str, [x, y]: [f64; 2]) {
        self.write(text, &format!("transform=\"translate({x:.1} {y:.1}) rotate(-90)\""), Anchor::Middle);
    }

    /// Text that climbs upward from a place, its middle at that distance from the left.
    pub fn climbing(&mut self, text: &str, [x, y]: [f64; 2]) {
        let place = format!("transform=\"translate({:.1} {y:.1}) rotate(-90)\"", x + 4.5);
        self.write(text, &place, Anchor::Start);
    }

    /// A filled rectangle from its upper left corner.
    pub fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], fill: &str) {
        let _ = writeln!(
            self.body,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{fill}\"/>"
        );
    }

    fn write(&mut self, text: &str, place: &str, anchor: Anchor) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        let _ = writeln!(
            self.body,
            "<text {place} font-family=\"{FAMILY}\" font-size=\"13\" fill=\"{INK}\" text-anchor=\"{anchor}\">{text}</text>"
        );
    }

    /// The drawing as SVG.
    pub fn svg(&self) -> String {
        let [width, height] = self.size;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n{}</svg>\n",
            self.body
        )
    }

    /// The drawing as PNG.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        let svg = self.svg();
        let mut options = usvg::Options { font_family: FAMILY.into(), ..usvg::Options::default() };
        let fonts = Arc::make_mut(&mut options.fontdb);
        fonts.load_font_data(FONT.to_vec());
        fonts.set_sans_serif_family(FAMILY);
        let tree = usvg::Tree::from_str(&svg, &options).map_err(|error| error.to_string())?;
        let size = tree.size().to_int_size().scale_by(ZOOM).ok_or("it has no size")?;
        let mut pixels = tiny_skia::Pixmap::new(size.width(), size.height()).ok_or("it is too large")?;
        resvg::render(&tree, tiny_skia::Transform::from_scale(ZOOM, ZOOM), &mut pixels.as_mut());
        packed(&pixels)
    }
}

/// A picture of another program, packed as tight as those of this one; halved until it is not larger than `most` bytes.
pub fn repacked(png: &[u8], most: usize) -> Result<Vec<u8>, String> {
    let mut pixels = tiny_skia::Pixmap::decode_png(png).map_err(|error| error.to_string())?;
    let mut small = packed(&pixels)?;
    while small.len() > most && pixels.width() > 400 {
        let mut half = tiny_skia::Pixmap::new(pixels.width() / 2, pixels.height() / 2).ok_or("it has no size")?;
        let paint = tiny_skia::PixmapPaint { quality: tiny_skia::FilterQuality::Bilinear, ..Default::default() };
        half.draw_pixmap(0, 0, pixels.as_ref(), &paint, tiny_skia::Transform::from_scale(0.5, 0.5), None);
        small = packed(&half)?;
        pixels = half;
    }
    Ok(small)
}

/// As opaque PNG, as small as it goes: these pictures are kept with the sources.
fn packed(pixels: &tiny_skia::Pixmap) -> Result<Vec<u8>, String> {
    let colours: Vec<u8> = pixels.data().chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, pixels.width(), pixels.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Best);
    // Most of it is one colour, which filters would only hide.
    encoder.set_filter(png::FilterType::NoFilter);
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    writer.write_image_data(&colours).map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_packed_and_halved_where_they_must() {
        let mut paper = Paper::new([600.0, 300.0]);
        paper.text("Run-out ∞ √ μ φ °", [20.0, 20.0], Anchor::Start);
        paper.line(&[[0.0, 0.0], [600.0, 300.0]], INK, 2.0, "");
        let png = paper.png().unwrap();
        let size = |png: &[u8]| tiny_skia::Pixmap::decode_png(png).map(|p| (p.width(), p.height())).unwrap();
        assert_eq!(size(&png), (1200, 600));
        assert_eq!(repacked(&png, png.len()).unwrap(), png);
        let small = repacked(&png, png.len() - 1).unwrap();
        assert_eq!(size(&small), (600, 300));
        assert!(small.len() < png.len());
    }
}
