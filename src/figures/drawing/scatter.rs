//! Figures of tables: panels of points with error bars, joined or not, and reference lines.

use super::colour::{GREY, SERIES};
use super::panel::Sides;
use super::ticks::range_of;
use super::{
    Align, Axis, COLUMN_MM, Figure, Font, Key, Legend, Marker, PAGE_MM, PT_PER_MM, Panel, Rect, Scale, Stroke,
};

/// Error bars of a series.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Errors {
    /// None.
    #[default]
    None,
    /// The same length to either side, one for each point.
    Symmetric(Vec<f64>),
    /// Lengths downwards and upwards, one pair for each point.
    Asymmetric(Vec<[f64; 2]>),
}

impl Errors {
    /// Ends of the bar of point `k` at `value`.
    fn ends(&self, k: usize, value: f64) -> Option<[f64; 2]> {
        let [down, up] = match self {
            Errors::None => return None,
            Errors::Symmetric(errors) => [*errors.get(k)?; 2],
            Errors::Asymmetric(errors) => *errors.get(k)?,
        };
        Some([value - down, value + up])
    }
}

/// A series of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Its text in the legend; empty for none.
    pub label: String,
    /// Horizontal positions.
    pub x: Vec<f64>,
    /// Vertical positions; as many as `x`. A point that is not finite is omitted.
    pub y: Vec<f64>,
    /// Error bars along x.
    pub x_errors: Errors,
    /// Error bars along y.
    pub y_errors: Errors,
    /// Whether points are joined by a line.
    pub joined: bool,
    /// Whether only the line and the error bars are drawn, without points.
    pub bare: bool,
}

/// A reference line.
#[derive(Clone, Debug, PartialEq)]
pub enum Reference {
    /// y = x.
    Diagonal {
        /// Its text in the legend; empty for none.
        label: String,
    },
    /// A horizontal line.
    Horizontal {
        /// Its position.
        at: f64,
        /// Its text in the legend; empty for none.
        label: String,
    },
    /// A vertical line.
    Vertical {
        /// Its position.
        at: f64,
        /// Its text in the legend; empty for none.
        label: String,
    },
}

/// A panel of such a figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScatterPanel {
    /// Title above the panel; empty for none.
    pub title: String,
    /// The quantity x, with its unit, in the markup of [`Figure::text`].
    pub x_label: String,
    /// The quantity y.
    pub y_label: String,
    /// Range along x; by default that of all points and bars.
    pub x_range: Option<[f64; 2]>,
    /// The same along y.
    pub y_range: Option<[f64; 2]>,
    /// Scale along x.
    pub x_scale: Scale,
    /// Scale along y.
    pub y_scale: Scale,
    /// The series; colour and shape follow from the index.
    pub series: Vec<Series>,
    /// Reference lines.
    pub references: Vec<Reference>,
    /// Position of the legend: 0, 0.5 or 1 from the left and from above; by default where it covers the fewest points.
    pub legend_at: Option<[f64; 2]>,
}

/// Margins of a panel: left, right, above, below (pt).
const MARGINS: [f64; 4] = [38.0, 8.0, 16.0, 26.0];

/// A figure of such panels, in rows of `columns`: as wide as a column of a journal if that is 1, otherwise as a page. A
/// legend in the first of several panels that applies to all is placed above them.
pub fn scatter(name: &str, panels: &[ScatterPanel], columns: usize) -> Figure {
    let columns = columns.max(1);
    let rows = panels.len().div_ceil(columns).max(1);
    let width_mm = if columns == 1 { COLUMN_MM } else { PAGE_MM };
    let cell_width = width_mm * PT_PER_MM / columns as f64;
    let [left, right, above, below] = MARGINS;
    let height = 0.78 * (cell_width - left - right);
    let cell_height = height + above + below;
    let labelled = |panel: &ScatterPanel| panel.series.iter().any(|series| !series.label.is_empty());
    let shared = panels.len() > 1
        && panels.iter().all(|panel| panel.title.is_empty() && panel.references.is_empty())
        && !panels[1..].iter().any(labelled);
    let mut figure = Figure::new(name, width_mm, rows as f64 * cell_height / PT_PER_MM);
    for (k, panel) in panels.iter().enumerate() {
        let (row, column) = ((k / columns) as f64, (k % columns) as f64);
        let frame = Rect {
            left: column * cell_width + left,
            top: row * cell_height + above,
            width: cell_width - left - right,
            height,
        };
        if shared {
            panel.draw_content(&mut figure, frame);
        } else {
            panel.draw(&mut figure, frame);
        }
    }
    if shared {
        let mut legend = Legend::default();
        for (k, first) in panels[0].series.iter().enumerate() {
            if panels.iter().filter_map(|panel| panel.series.get(k)).any(Series::has_points) {
                legend.add(key(first, k), &first.label);
            }
        }
        legend.row(&mut figure, [0.5 * width_mm * PT_PER_MM, 0.5 * above]);
    }
    figure
}

impl Series {
    fn has_points(&self) -> bool {
        self.x.iter().zip(&self.y).any(|(x, y)| x.is_finite() && y.is_finite())
    }
}

impl ScatterPanel {
    /// Draws the panel in `frame`; numbers and labels need some 35 pt to its left and 28 pt below.
    pub fn draw(&self, figure: &mut Figure, frame: Rect) {
        let legend = self.draw_content(figure, frame);
        let points: Vec<[f64; 2]> =
            self.series.iter().flat_map(|s| s.x.iter().zip(&s.y)).map(|(x, y)| [*x, *y]).collect();
        let corner = self.legend_at.unwrap_or_else(|| legend.free_corner(frame, &self.panel(frame).places(&points)));
        legend.draw(figure, frame, corner);
        if !self.title.is_empty() {
            figure.text(&self.title, [frame.centre()[0], frame.top - 5.0], Font::LABEL, Align::Centre, 0.0);
        }
    }

    fn panel(&self, frame: Rect) -> Panel {
        let [x, y] = self.axes();
        Panel { frame, x, y }
    }

    /// Draws all but the title and the legend, which it returns.
    fn draw_content(&self, figure: &mut Figure, frame: Rect) -> Legend {
        let panel = self.panel(frame);
        let mut legend = Legend::default();
        for reference in &self.references {
            draw_reference(figure, &panel, reference, &mut legend);
        }
        for (k, series) in self.series.iter().enumerate() {
            draw_series(figure, &panel, series, k, &mut legend);
        }
        panel.frame(figure, Sides::BOTH);
        legend
    }

    fn axes(&self) -> [Axis; 2] {
        let points = |of: fn(&Series) -> (&[f64], &Errors)| {
            self.series.iter().flat_map(move |series| {
                let (values, errors) = of(series);
                let ends = move |(k, value): (usize, &f64)| errors.ends(k, *value).unwrap_or([*value; 2]);
                values.iter().enumerate().flat_map(ends)
            })
        };
        let level = |reference: &Reference, upright: bool| match reference {
            Reference::Horizontal { at, .. } if !upright => Some(*at),
            Reference::Vertical { at, .. } if upright => Some(*at),
            _ => None,
        };
        let levels = |upright: bool| self.references.iter().filter_map(move |reference| level(reference, upright));
        let x = points(|series| (&series.x, &series.x_errors)).chain(levels(true));
        let y = points(|series| (&series.y, &series.y_errors)).chain(levels(false));
        let axis = |label: &str, range: Option<[f64; 2]>, found: [f64; 2], scale: Scale| Axis {
            label: label.into(),
            range: range.unwrap_or(found),
            scale,
        };
        let (x, y) = (range_of(x, self.x_scale, 0.06), range_of(y, self.y_scale, 0.06));
        [axis(&self.x_label, self.x_range, x, self.x_scale), axis(&self.y_label, self.y_range, y, self.y_scale)]
    }
}

fn draw_reference(figure: &mut Figure, panel: &Panel, reference: &Reference, legend: &mut Legend) {
    let stroke = Stroke::new(GREY, 0.8).dashed();
    let label = match reference {
        Reference::Diagonal { label } => {
            let low = panel.x.range[0].min(panel.x.range[1]);
            let high = panel.x.range[0].max(panel.x.range[1]);
            panel.line(figure, "reference", &[[low, low], [high, high]], stroke);
            label
        }
        Reference::Horizontal { at, label } => {
            panel.horizontal(figure, "reference", *at, stroke);
            label
        }
        Reference::Vertical { at, label } => {
            panel.vertical(figure, "reference", *at, stroke);
            label
        }
    };
    legend.add(Key::Line(stroke), label);
}

fn draw_series(figure: &mut Figure, panel: &Panel, series: &Series, k: usize, legend: &mut Legend) {
    let colour = SERIES[k % SERIES.len()];
    let marker = Marker::SERIES[k % Marker::SERIES.len()];
    let points: Vec<[f64; 2]> = series.x.iter().zip(&series.y).map(|(x, y)| [*x, *y]).collect();
    let line = Stroke::new(colour, 1.0);
    if series.joined {
        panel.line(figure, "series", &points, line);
    }
    for (k, [x, y]) in points.iter().enumerate() {
        if let Some([low, high]) = series.y_errors.ends(k, *y) {
            panel.bar(figure, "error-bar", [[*x, low], [*x, high]], 3.0, Stroke::new(colour, 0.7));
        }
        if let Some([low, high]) = series.x_errors.ends(k, *x) {
            panel.bar(figure, "error-bar", [[low, *y], [high, *y]], 3.0, Stroke::new(colour, 0.7));
        }
    }
    if !series.bare {
        panel.points(figure, "point", &points, (marker, 4.5, colour));
    }
    // a series without points needs no legend
    if series.has_points() {
        legend.add(key(series, k), &series.label);
    }
}

/// The sample of series `k` in the legend.
fn key(series: &Series, k: usize) -> Key {
    let colour = SERIES[k % SERIES.len()];
    let marker = Marker::SERIES[k % Marker::SERIES.len()];
    let line = Stroke::new(colour, 1.0);
    match (series.joined, series.bare) {
        (true, true) => Key::Line(line),
        (true, false) => Key::Both(line, marker, colour),
        (false, _) => Key::Point(marker, colour),
    }
}
