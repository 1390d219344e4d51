//! Legends: one sample and text per line, in a corner of a panel or in a row above it.

use super::colour::WHITE;
use super::{Align, Colour, Figure, Font, Marker, Paint, Point, Rect, SMALL_PT, Stroke, width_pt};

/// The sample in a line of a legend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Key {
    /// A line.
    Line(Stroke),
    /// A point.
    Point(Marker, Colour),
    /// A point on a line.
    Both(Stroke, Marker, Colour),
    /// An area.
    Area(Colour),
}

/// Lines of a legend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Legend {
    entries: Vec<(Key, String)>,
}

/// Width of a sample (pt).
const SAMPLE: f64 = 14.0;
/// Distance of lines (pt).
const LINE: f64 = 9.5;
/// Between samples, texts and sides (pt).
const PAD: f64 = 3.5;

impl Legend {
    /// Adds a line, unless the text is empty.
    pub fn add(&mut self, key: Key, text: &str) {
        if !text.is_empty() {
            self.entries.push((key, text.into()));
        }
    }

    /// Whether it has no line.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Its rectangle in a corner of `frame`: 0, 0.5 or 1 from the left and from above.
    fn place(&self, frame: Rect, corner: Point) -> Rect {
        let widest = self.entries.iter().map(|(_, text)| width_pt(text, SMALL_PT)).fold(0.0, f64::max);
        let width = SAMPLE + widest + 3.0 * PAD;
        let height = LINE * self.entries.len() as f64 + PAD;
        // away from the ticks
        let margin = 5.0;
        let left = frame.left + margin + corner[0] * (frame.width - width - 2.0 * margin);
        let top = frame.top + margin + corner[1] * (frame.height - height - 2.0 * margin);
        Rect { left, top, width, height }
    }

    /// The corner of `frame` where it covers the fewest of `points`; the first of equals, from the upper left.
    pub fn free_corner(&self, frame: Rect, points: &[Point]) -> Point {
        const CORNERS: [Point; 6] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.0], [0.5, 1.0]];
        let covered = |corner: &Point| {
            let Rect { left, top, width, height } = self.place(frame, *corner);
            let inside = |[x, y]: &&Point| (left..left + width).contains(x) && (top..top + height).contains(y);
            points.iter().filter(inside).count()
        };
        CORNERS.into_iter().min_by_key(covered).unwrap_or_default()
    }

    /// Draws it in a corner of `frame`, or in the middle of a side: `corner` is 0, 0.5 or 1 from the left and from
    /// above.
    pub fn draw(&self, figure: &mut Figure, frame: Rect, corner: Point) {
        if self.entries.is_empty() {
            return;
        }
        let Rect { left, top, width, height } = self.place(frame, corner);
        figure.rect("legend", Rect { left, top, width, height }, Paint::fill(WHITE.opacity(0.8)));
        for (k, (key, text)) in self.entries.iter().enumerate() {
            entry(figure, *key, text, [left + PAD, top + 0.5 * PAD + LINE * (k as f64 + 0.5)]);
        }
    }

    /// Draws it in a row that is centred at `x` and whose middle is at `y`.
    pub fn row(&self, figure: &mut Figure, [x, y]: Point) {
        let width = |text: &str| SAMPLE + PAD + width_pt(text, SMALL_PT) + 3.0 * PAD;
        let total: f64 = self.entries.iter().map(|(_, text)| width(text)).sum();
        let mut left = x - 0.5 * (total - 3.0 * PAD);
        for (key, text) in &self.entries {
            entry(figure, *key, text, [left, y]);
            left += width(text);
        }
    }
}

/// A sample and its text, from the left, centred about a height.
fn entry(figure: &mut Figure, key: Key, text: &str, [left, middle]: Point) {
    let line = [[left, middle], [left + SAMPLE, middle]];
    let centre = [left + 0.5 * SAMPLE, middle];
    match key {
        Key::Line(stroke) => figure.polyline("legend", &line, stroke),
        Key::Point(marker, colour) => marker.draw(figure, "legend", centre, 4.5, colour),
        Key::Both(stroke, marker, colour) => {
            figure.polyline("legend", &line, stroke);
            marker.draw(figure, "legend", centre, 4.5, colour);
        }
        Key::Area(colour) => {
            let area = Rect { left, top: middle - 3.0, width: SAMPLE, height: 6.0 };
            figure.rect("legend", area, Paint::fill(colour));
        }
    }
    figure.text(text, [left + SAMPLE + PAD, middle + 0.36 * SMALL_PT], Font::SMALL, Align::Left, 0.0);
}
