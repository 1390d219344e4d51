//! Figures for papers: one description, two files. A [`Figure`] is a list of shapes and texts on a page; it is written
//! as SVG ([`Figure::svg`]) and as PNG ([`Figure::png`]), the same bytes every time.
//!
//! On top of it: a [`Panel`] with axes turns data into shapes, [`scatter()`] makes whole figures of tables (points with
//! error bars, lines, a reference line), [`contour`] computes contours. Colours remain distinguishable with colour
//! blindness and in grey print, the font is included in the program, and a figure has the width of a column
//! ([`COLUMN_MM`]) or a page ([`PAGE_MM`]) of a journal. Lengths on the page are points (1/72 inch) from its upper left
//! corner.
//!
//! Recovered compared with injected K, with error bars and the line of equality:
//!
//! ```
//! use dimcmc::internals::figures::drawing::{Errors, Reference, ScatterPanel, Series, scatter};
//!
//! let panel = ScatterPanel {
//!     x_label: "injected *K* (km/s)".into(),
//!     y_label: "recovered *K* (km/s)".into(),
//!     references: vec![Reference::Diagonal { label: "recovered = injected".into() }],
//!     series: vec![Series {
//!         label: "S/N 1000".into(),
//!         x: vec![0.05, 0.10, 0.15],
//!         y: vec![0.057, 0.103, 0.148],
//!         y_errors: Errors::Symmetric(vec![0.010, 0.010, 0.011]),
//!         ..Series::default()
//!     }],
//!     ..ScatterPanel::default()
//! };
//! let figure = scatter("recovered", &[panel], 1);
//! let (svg, png) = (figure.svg(), figure.png(200.0));
//! # assert!(svg.starts_with("<svg") && png.starts_with(b"\x89PNG"));
//! ```

pub mod colour;
pub mod contour;
mod frame;
mod legend;
pub mod panel;
mod png;
mod scatter;
mod smooth;
mod svg;
mod text;
mod ticks;

pub use colour::{Colour, ColourMap};
pub use legend::{Key, Legend};
pub use panel::{Axis, Marker, Panel, Scale};
pub use scatter::{Errors, Reference, ScatterPanel, Series, scatter};
pub use text::{Align, Font, plain, width_pt};
pub use ticks::range_of;

/// Width of a column (mm).
pub const COLUMN_MM: f64 = 88.0;

/// Width of a page (mm).
pub const PAGE_MM: f64 = 180.0;

/// Size of axis labels (pt).
pub const LABEL_PT: f64 = 8.0;

/// Size of the numbers at ticks, and of legends (pt).
pub const SMALL_PT: f64 = 7.0;

/// Points in a millimetre.
const PT_PER_MM: f64 = 72.0 / 25.4;

/// A position on the page (pt from the left and from the top).
pub type Point = [f64; 2];

/// A rectangle on the page (pt).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Left side.
    pub left: f64,
    /// Upper side.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Rect {
    /// The right side.
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// The lower side.
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// The middle.
    pub fn centre(&self) -> Point {
        [self.left + 0.5 * self.width, self.top + 0.5 * self.height]
    }
}

/// A segment of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Segment {
    /// Begins a new line.
    Move(Point),
    /// A straight line.
    Line(Point),
    /// A quadratic Bezier curve by its control point.
    Quad(Point, Point),
    /// A cubic Bezier curve by its two control points.
    Cubic(Point, Point, Point),
    /// Back to the beginning of the line.
    Close,
}

/// A pen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Colour.
    pub colour: Colour,
    /// Width (pt).
    pub width: f64,
    /// Lengths of dashes and gaps (pt); a line without gaps if empty.
    pub dash: &'static [f64],
}

impl Stroke {
    /// A pen without gaps.
    pub const fn new(colour: Colour, width: f64) -> Self {
        Stroke { colour, width, dash: &[] }
    }

    /// The same with dashes.
    pub const fn dashed(self) -> Self {
        Stroke { dash: &[3.5, 2.0], ..self }
    }

    /// The same with dots.
    pub const fn dotted(self) -> Self {
        Stroke { dash: &[1.0, 1.6], ..self }
    }
}

/// Fill and outline of a path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Paint {
    /// Colour of its inside.
    pub fill: Option<Colour>,
    /// Pen of its outline.
    pub stroke: Option<Stroke>,
    /// Without anti-aliasing, for areas that touch or overlap each other. Elsewhere an area within an area is a hole.
    pub sharp: bool,
}

impl Paint {
    /// An outline.
    pub const fn stroke(stroke: Stroke) -> Self {
        Paint { fill: None, stroke: Some(stroke), sharp: false }
    }

    /// An area.
    pub const fn fill(colour: Colour) -> Self {
        Paint { fill: Some(colour), stroke: None, sharp: false }
    }

    /// An area that touches others.
    pub const fn cell(colour: Colour) -> Self {
        Paint { fill: Some(colour), stroke: None, sharp: true }
    }
}

/// An item of the page.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Item {
    /// A shape. `class` is its meaning, `clip` the index of the clipping path.
    Path { class: &'static str, segments: Vec<Segment>, paint: Paint, clip: Option<usize> },
    /// A text with its glyphs.
    Text { text: String, glyphs: Vec<text::Glyph>, colour: Colour },
}

/// A figure: shapes and texts on a page.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Its name, also that of its files.
    pub name: String,
    /// Its content, in a sentence or two.
    pub caption: String,
    /// Its limitations, one line each.
    pub notes: Vec<String>,
    /// Width of the page (pt).
    pub width: f64,
    /// Height of the page (pt).
    pub height: f64,
    items: Vec<Item>,
    clips: Vec<Vec<Segment>>,
    clip: Option<usize>,
}

impl Figure {
    /// An empty page.
    pub fn new(name: &str, width_mm: f64, height_mm: f64) -> Self {
        Figure {
            name: name.into(),
            caption: String::new(),
            notes: Vec::new(),
            width: width_mm * PT_PER_MM,
            height: height_mm * PT_PER_MM,
            items: Vec::new(),
            clips: Vec::new(),
            clip: None,
        }
    }

    /// Draws a path; `class` is its meaning, for the SVG.
    pub fn path(&mut self, class: &'static str, segments: Vec<Segment>, paint: Paint) {
        if !segments.is_empty() {
            self.items.push(Item::Path { class, segments, paint, clip: self.clip });
        }
    }

    /// Draws straight lines from point to point.
    pub fn polyline(&mut self, class: &'static str, points: &[Point], stroke: Stroke) {
        self.path(class, open(points), Paint::stroke(stroke));
    }

    /// Draws an area with straight sides.
    pub fn polygon(&mut self, class: &'static str, points: &[Point], paint: Paint) {
        self.path(class, closed(points), paint);
    }

    /// Draws a rectangle.
    pub fn rect(&mut self, class: &'static str, rect: Rect, paint: Paint) {
        self.path(class, rectangle(rect), paint);
    }

    /// Draws an ellipse.
    pub fn ellipse(&mut self, class: &'static str, centre: Point, radii: [f64; 2], paint: Paint) {
        self.path(class, ellipse(centre, radii), paint);
    }

    /// Writes a text: `*italic*`, `_{subscript}`, `^{superscript}`. `at` is on the baseline, `turn` in degrees,
    /// anticlockwise.
    pub fn text(&mut self, text: &str, at: Point, font: Font, align: Align, turn: f64) {
        let glyphs = text::lay_out(text, at, font.size, align, turn);
        self.items.push(Item::Text { text: plain(text), glyphs, colour: font.colour });
    }

    /// Clips the result of `draw` to `outline`.
    pub fn clipped(&mut self, outline: Vec<Segment>, draw: impl FnOnce(&mut Figure)) {
        let before = self.clip.replace(self.clips.len());
        self.clips.push(outline);
        draw(self);
        self.clip = before;
    }

    /// The figure as SVG.
    pub fn svg(&self) -> String {
        svg::write(self)
    }

    /// The figure as PNG with so many pixels per inch.
    pub fn png(&self, dpi: f64) -> Vec<u8> {
        png::write(self, dpi)
    }
}

/// The path from point to point.
pub fn open(points: &[Point]) -> Vec<Segment> {
    points.iter().enumerate().map(|(k, p)| if k == 0 { Segment::Move(*p) } else { Segment::Line(*p) }).collect()
}

/// The same, closed.
pub fn closed(points: &[Point]) -> Vec<Segment> {
    let mut path = open(points);
    if !path.is_empty() {
        path.push(Segment::Close);
    }
    path
}

/// The outline of a rectangle.
pub fn rectangle(rect: Rect) -> Vec<Segment> {
    let Rect { left, top, .. } = rect;
    closed(&[[left, top], [rect.right(), top], [rect.right(), rect.bottom()], [left, rect.bottom()]])
}

/// The outline of an ellipse, of four cubic curves.
pub fn ellipse([x, y]: Point, [a, b]: [f64; 2]) -> Vec<Segment> {
    // control points for which the curves are within 3e-4 of the radius
    const C: f64 = 0.552_284_75;
    let at = |u: f64, v: f64| [x + a * u, y + b * v];
    vec![
        Segment::Move(at(1.0, 0.0)),
        Segment::Cubic(at(1.0, C), at(C, 1.0), at(0.0, 1.0)),
        Segment::Cubic(at(-C, 1.0), at(-1.0, C), at(-1.0, 0.0)),
        Segment::Cubic(at(-1.0, -C), at(-C, -1.0), at(0.0, -1.0)),
        Segment::Cubic(at(C, -1.0), at(1.0, -C), at(1.0, 0.0)),
        Segment::Close,
    ]
}
