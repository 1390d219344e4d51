//! A panel: a rectangle of the page with two axes, and data drawn in it. Shapes drawn by its axes are clipped to it.

use super::colour::{BLACK, Colour, ColourMap, WHITE};
use super::{Figure, Paint, Point, Rect, Segment, Stroke, closed, open, rectangle, smooth};
use std::collections::BTreeMap;

/// The map from values to lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Linear.
    #[default]
    Linear,
    /// Logarithmic; all values must be above 0.
    Log,
}

/// One axis: its quantity and range.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its quantity, with its unit, in the markup of [`Figure::text`].
    pub label: String,
    /// Values at its ends; the first may be the larger one.
    pub range: [f64; 2],
    /// The map from values to lengths.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str, range: [f64; 2]) -> Self {
        Axis { label: label.into(), range, scale: Scale::Linear }
    }

    /// A logarithmic axis.
    pub fn log(label: &str, range: [f64; 2]) -> Self {
        Axis { label: label.into(), range, scale: Scale::Log }
    }

    /// The position of a value: 0 at the first end, 1 at the second.
    pub fn share(&self, value: f64) -> f64 {
        let [first, last] = self.range;
        match self.scale {
            Scale::Linear => (value - first) / (last - first),
            Scale::Log => (value / first).ln() / (last / first).ln(),
        }
    }

    /// The value at a fraction of the distance from the first end to the second.
    pub fn value(&self, share: f64) -> f64 {
        let [first, last] = self.range;
        match self.scale {
            Scale::Linear => first + share * (last - first),
            Scale::Log => first * (last / first).powf(share),
        }
    }
}

/// Shape of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// A disc.
    Disc,
    /// A square.
    Square,
    /// A triangle.
    Triangle,
    /// A diamond.
    Diamond,
    /// A ring.
    Ring,
    /// An upright cross.
    Plus,
    /// A slanted cross.
    Cross,
}

impl Marker {
    /// Shapes of series, in order.
    pub const SERIES: [Marker; 7] =
        [Marker::Disc, Marker::Square, Marker::Triangle, Marker::Diamond, Marker::Ring, Marker::Cross, Marker::Plus];

    /// Draws it at a position of the page, `size` points wide.
    pub fn draw(self, figure: &mut Figure, class: &'static str, at: Point, size: f64, colour: Colour) {
        let r = 0.5 * size;
        let corner = |x: f64, y: f64| [at[0] + r * x, at[1] + r * y];
        let pen = Stroke::new(colour, (0.22 * size).clamp(0.6, 1.2));
        let solid = Paint::fill(colour);
        match self {
            Marker::Disc => figure.ellipse(class, at, [r, r], solid),
            Marker::Ring => {
                let paint = Paint { fill: Some(WHITE), stroke: Some(pen), sharp: false };
                figure.ellipse(class, at, [0.9 * r, 0.9 * r], paint);
            }
            Marker::Square => {
                let corners = [corner(-0.9, -0.9), corner(0.9, -0.9), corner(0.9, 0.9), corner(-0.9, 0.9)];
                figure.polygon(class, &corners, solid);
            }
            Marker::Triangle => {
                figure.polygon(class, &[corner(0.0, -1.15), corner(1.1, 0.8), corner(-1.1, 0.8)], solid);
            }
            Marker::Diamond => {
                let corners = [corner(0.0, -1.25), corner(1.25, 0.0), corner(0.0, 1.25), corner(-1.25, 0.0)];
                figure.polygon(class, &corners, solid);
            }
            Marker::Plus | Marker::Cross => {
                let (a, b) = if self == Marker::Plus { (1.2, 0.0) } else { (0.9, 0.9) };
                let lines = [corner(-a, -b), corner(a, b), corner(b, -a), corner(-b, a)];
                let path = lines.chunks(2).flat_map(open).collect();
                figure.path(class, path, Paint::stroke(pen));
            }
        }
    }
}

/// A rectangle of the page with axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Its rectangle.
    pub frame: Rect,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
}

/// The sides with ticks, numbers and labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sides {
    /// Numbers and label below the panel.
    pub below: bool,
    /// Numbers and label to its left.
    pub left: bool,
}

impl Sides {
    /// All of it.
    pub const BOTH: Sides = Sides { below: true, left: true };
}

impl Panel {
    /// The position of a pair of values on the page.
    pub fn place(&self, x: f64, y: f64) -> Point {
        let Rect { left, width, height, .. } = self.frame;
        [left + self.x.share(x) * width, self.frame.bottom() - self.y.share(y) * height]
    }

    /// Clips the result of `draw` to the panel.
    pub fn clipped(&self, figure: &mut Figure, draw: impl FnOnce(&mut Figure)) {
        figure.clipped(rectangle(self.frame), draw);
    }

    /// A line from point to point; it breaks where a value is not finite.
    pub fn line(&self, figure: &mut Figure, class: &'static str, points: &[[f64; 2]], stroke: Stroke) {
        let pieces = points.split(|p| !(p[0].is_finite() && p[1].is_finite()));
        let path: Vec<Segment> = pieces.flat_map(|piece| open(&self.places(piece))).collect();
        self.clipped(figure, |figure| figure.path(class, path, Paint::stroke(stroke)));
    }

    /// A smooth line through points in the order of their x, with extrema only at points; it breaks where a value is
    /// not finite.
    pub fn smooth_line(&self, figure: &mut Figure, class: &'static str, points: &[[f64; 2]], stroke: Stroke) {
        let places = self.places(points);
        let pieces = places.split(|p| !(p[0].is_finite() && p[1].is_finite()));
        let path: Vec<Segment> = pieces.flat_map(smooth::curve).collect();
        self.clipped(figure, |figure| figure.path(class, path, Paint::stroke(stroke)));
    }

    /// A closed area.
    pub fn area(&self, figure: &mut Figure, class: &'static str, points: &[[f64; 2]], paint: Paint) {
        let path = closed(&self.places(points));
        self.clipped(figure, |figure| figure.path(class, path, paint));
    }

    /// Points, `size` points wide.
    pub fn points(&self, figure: &mut Figure, class: &'static str, points: &[[f64; 2]], marker: (Marker, f64, Colour)) {
        let (marker, size, colour) = marker;
        self.clipped(figure, |figure| {
            for at in self.places(points).into_iter().filter(|at| at[0].is_finite() && at[1].is_finite()) {
                marker.draw(figure, class, at, size, colour);
            }
        });
    }

    /// A bar from one pair of values to another, with caps across its ends if `cap` (pt) is above 0.
    pub fn bar(&self, figure: &mut Figure, class: &'static str, ends: [[f64; 2]; 2], cap: f64, stroke: Stroke) {
        let [a, b] = ends.map(|[x, y]| self.place(x, y));
        if ![a, b].iter().flatten().all(|x| x.is_finite()) {
            return;
        }
        let mut path = open(&[a, b]);
        if cap > 0.0 {
            let across = if (a[0] - b[0]).abs() > (a[1] - b[1]).abs() { [0.0, 0.5 * cap] } else { [0.5 * cap, 0.0] };
            for [x, y] in [a, b] {
                path.extend(open(&[[x - across[0], y - across[1]], [x + across[0], y + across[1]]]));
            }
        }
        self.clipped(figure, |figure| figure.path(class, path, Paint::stroke(stroke)));
    }

    /// A line through the panel at `x`.
    pub fn vertical(&self, figure: &mut Figure, class: &'static str, x: f64, stroke: Stroke) {
        self.line(figure, class, &[[x, self.y.range[0]], [x, self.y.range[1]]], stroke);
    }

    /// A line across the panel at `y`.
    pub fn horizontal(&self, figure: &mut Figure, class: &'static str, y: f64, stroke: Stroke) {
        self.line(figure, class, &[[self.x.range[0], y], [self.x.range[1], y]], stroke);
    }

    /// Tiles from x0 to x1 and y0 to y1 in the colours of their values; values that are not finite are not painted.
    pub fn tiles(&self, figure: &mut Figure, tiles: impl Iterator<Item = Tile>, shade: Shade) {
        let mut of_colour: BTreeMap<[u8; 4], Vec<Segment>> = BTreeMap::new();
        for Tile { x: [x0, x1], y: [y0, y1], value } in tiles {
            if let Some(Colour(colour)) = shade.colour(value) {
                let corners = self.places(&[[x0, y0], [x1, y0], [x1, y1], [x0, y1]]);
                of_colour.entry(colour).or_default().extend(closed(&corners));
            }
        }
        self.clipped(figure, |figure| {
            for (colour, path) in of_colour {
                figure.path("tiles", path, Paint::cell(Colour(colour)));
            }
        });
    }

    /// A text within the panel, at fractions of its width (from the left) and height (from above).
    pub fn note(&self, figure: &mut Figure, text: &str, at: Point, align: super::Align) {
        let place = [self.frame.left + at[0] * self.frame.width, self.frame.top + at[1] * self.frame.height];
        figure.text(text, place, super::Font::SMALL.coloured(BLACK), align, 0.0);
    }

    pub(super) fn places(&self, points: &[[f64; 2]]) -> Vec<Point> {
        points.iter().map(|[x, y]| self.place(*x, *y)).collect()
    }
}

/// A rectangle with a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Range along x.
    pub x: [f64; 2],
    /// The same along y.
    pub y: [f64; 2],
    /// The value.
    pub value: f64,
}

/// The colour scale of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shade {
    /// The colours.
    pub map: ColourMap,
    /// The value of the first colour.
    pub low: f64,
    /// The value of the last colour.
    pub high: f64,
}

impl Shade {
    /// The colour of a value; `None` if it is not finite.
    pub fn colour(&self, value: f64) -> Option<Colour> {
        value.is_finite().then(|| self.map.at((value - self.low) / (self.high - self.low)))
    }
}

/// Points of the ellipse `radius` standard deviations from `centre`.
pub fn gaussian_contour(centre: [f64; 2], covariance: [[f64; 2]; 2], radius: f64) -> Vec<[f64; 2]> {
    // Cholesky factor: a circle becomes the ellipse
    let a = covariance[0][0].max(0.0).sqrt();
    let b = if a > 0.0 { covariance[0][1] / a } else { 0.0 };
    let c = (covariance[1][1] - b * b).max(0.0).sqrt();
    let at = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / 96.0).sin_cos();
        [centre[0] + radius * a * cos, centre[1] + radius * (b * cos + c * sin)]
    };
    (0..=96).map(at).collect()
}
