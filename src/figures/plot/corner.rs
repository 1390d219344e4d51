//! Corner plots: the marginal of every parameter and of every pair. For a chain: histograms, and contours of 68 and 95
//! % of the draws; a periodic parameter is unwrapped around its mode, and one with a log-uniform prior has a
//! logarithmic axis.

use super::density::Density;
use super::symbols::{Shown, Title};
use super::trace::{Sampled, TRUTH, shown_range};
use crate::figures::drawing::colour::{BLACK, BLUE, WHITE};
use crate::figures::drawing::panel::Sides;
use crate::figures::drawing::{
    Align, Axis, COLUMN_MM, Figure, Font, Key, Legend, PAGE_MM, Paint, Panel, Rect, Scale, Segment, Stroke, closed,
    width_pt,
};

/// A triangle of panels.
pub(super) struct Corner<'a> {
    pub shown: &'a [Shown],
    /// The plotted range of each parameter.
    pub ranges: Vec<[f64; 2]>,
    /// The scale of its axis.
    pub scales: Vec<Scale>,
    /// Injected values.
    pub truth: Vec<Option<f64>>,
    /// Titles above the histograms.
    pub titles: Vec<Title>,
}

/// Room to the left and below (pt).
const MARGIN: [f64; 2] = [40.0, 32.0];

impl Corner<'_> {
    /// Draws all panels; `diagonal` and `pair` draw their content, before frames and injected values.
    pub fn draw(
        &self,
        name: &str,
        diagonal: impl Fn(&mut Figure, Rect, Axis, usize),
        pair: impl Fn(&mut Figure, &Panel, usize, usize),
        legend: &Legend,
    ) -> Figure {
        let n = self.shown.len();
        let size = match n {
            1 => COLUMN_MM,
            2 => 110.0,
            3 => 140.0,
            _ => PAGE_MM,
        };
        let mut figure = Figure::new(name, size, size);
        let gap = 4.0;
        let side = (figure.width - MARGIN[0] - 6.0 - gap * (n as f64 - 1.0)) / n as f64;
        let titles = titles(&self.titles, side);
        let top = 8.0 + 9.0 * titles.iter().map(Vec::len).max().unwrap_or(1) as f64;
        let height = (figure.height - top - MARGIN[1] - gap * (n as f64 - 1.0)) / n as f64;
        let named = if n > 3 { Shown::short_label } else { Shown::label };
        let axis = |i: usize| Axis { label: named(&self.shown[i]), range: self.ranges[i], scale: self.scales[i] };
        for (row, title) in titles.iter().enumerate() {
            for column in 0..=row {
                let frame = Rect {
                    left: MARGIN[0] + column as f64 * (side + gap),
                    top: top + row as f64 * (height + gap),
                    width: side,
                    height,
                };
                let sides = Sides { below: row + 1 == n, left: column == 0 && row > 0 };
                if row == column {
                    diagonal(&mut figure, frame, axis(row), row);
                    self.finish_diagonal(&mut figure, frame, axis(row), row, sides);
                    write_title(&mut figure, frame, title);
                } else {
                    let panel = Panel { frame, x: axis(column), y: axis(row) };
                    pair(&mut figure, &panel, column, row);
                    self.truth_lines(&mut figure, &panel, column, row);
                    panel.close_frame(&mut figure, sides);
                }
            }
        }
        if n > 1 {
            // the upper right is empty
            let left = MARGIN[0] + side + 2.0 * gap;
            let room = Rect { left, top: 4.0, width: figure.width - left - 4.0, height: top + height };
            legend.draw(&mut figure, room, [1.0, 0.0]);
        }
        figure
    }

    fn finish_diagonal(&self, figure: &mut Figure, frame: Rect, x: Axis, i: usize, sides: Sides) {
        let panel = Panel { frame, x, y: Axis::linear("", [0.0, 1.0]) };
        if let Some(truth) = self.truth[i] {
            panel.vertical(figure, "truth", truth, TRUTH);
        }
        if sides.below {
            panel.bare_y_frame(figure);
        } else {
            panel.bare_frame(figure);
        }
    }

    fn truth_lines(&self, figure: &mut Figure, panel: &Panel, column: usize, row: usize) {
        if let Some(x) = self.truth[column] {
            panel.vertical(figure, "truth", x, TRUTH);
        }
        if let Some(y) = self.truth[row] {
            panel.horizontal(figure, "truth", y, TRUTH);
        }
        if let (Some(x), Some(y)) = (self.truth[column], self.truth[row]) {
            let marker = (crate::figures::drawing::Marker::Square, 3.6, TRUTH.colour);
            panel.points(figure, "truth-point", &[[x, y]], marker);
        }
    }
}

/// Width of the widest of some lines (pt).
fn widest(lines: &[String]) -> f64 {
    lines.iter().map(|line| width_pt(line, Font::SMALL.size)).fold(0.0, f64::max)
}

/// All titles in as few lines as fit into panels of that width.
fn titles(titles: &[Title], width: f64) -> Vec<Vec<String>> {
    let all = |lines: usize| titles.iter().map(|title| title.lines(lines)).collect::<Vec<_>>();
    let fits = |titles: &Vec<Vec<String>>| titles.iter().all(|lines| widest(lines) <= width);
    (1..Title::LINES).map(all).find(fits).unwrap_or_else(|| all(Title::LINES))
}

/// Writes a title above a panel, in a smaller font where it would be wider.
fn write_title(figure: &mut Figure, frame: Rect, lines: &[String]) {
    let size = Font::SMALL.size * (frame.width / widest(lines).max(1.0)).min(1.0);
    for (k, line) in lines.iter().enumerate() {
        let up = 4.0 + 9.0 * (lines.len() - 1 - k) as f64;
        figure.text(line, [frame.centre()[0], frame.top - up], Font { size, ..Font::SMALL }, Align::Centre, 0.0);
    }
}

/// Fractions of the draws within contours.
pub(super) const SHARES: [f64; 2] = [0.95, 0.68];

/// Colours of the areas, in the order of [`SHARES`].
pub(super) fn area_colours() -> [crate::figures::drawing::Colour; 2] {
    [BLUE.opacity(0.25), BLUE.opacity(0.55)]
}

/// The corner plot of a chain.
pub(super) fn figure(sampled: &Sampled) -> Figure {
    let names = &sampled.summary.names;
    let shown: Vec<Shown> = (0..names.len()).map(|i| sampled.shown(i)).collect();
    let scaled = |i: usize, values: Vec<f64>| values.into_iter().map(|x| shown[i].factor * x).collect();
    let draws: Vec<Vec<f64>> = (0..names.len()).map(|i| scaled(i, sampled.draws(i))).collect();
    let range = |i: usize| {
        let factor = shown[i].factor;
        let also = sampled.near_truth(i).map(|x| factor * x);
        shown_range(&draws[i], sampled.bounds(i).map(|x| factor * x), also, sampled.scale(i))
    };
    let title = |i: usize| {
        let one = &sampled.summary.parameters[&names[i]];
        let errors = [one.median - one.ci68[0], one.ci68[1] - one.median];
        match one.unconstrained {
            true => Title::unconstrained(&shown[i]),
            false => Title::value(&shown[i], one.median, errors, one.sd),
        }
    };
    let corner = Corner {
        shown: &shown,
        ranges: (0..names.len()).map(range).collect(),
        scales: (0..names.len()).map(|i| sampled.scale(i)).collect(),
        truth: (0..names.len()).map(|i| Some(shown[i].factor * sampled.truth(i)?)).collect(),
        titles: (0..names.len()).map(title).collect(),
    };
    let mut legend = Legend::default();
    legend.add(Key::Area(area_colours()[1]), "68 % of the posterior");
    legend.add(Key::Area(area_colours()[0]), "95 % of the posterior");
    if corner.truth.iter().any(Option::is_some) {
        legend.add(Key::Line(TRUTH), "injected");
    }
    let diagonal = |figure: &mut Figure, frame: Rect, x: Axis, i: usize| {
        let one = &sampled.summary.parameters[&names[i]];
        let ci68 = one.ci68.map(|end| shown[i].factor * end);
        histogram(figure, frame, x, &draws[i], (!one.unconstrained).then_some(ci68));
    };
    let pair = |figure: &mut Figure, panel: &Panel, i: usize, j: usize| {
        // the density on a logarithmic axis is per fraction of the panel
        let both: Vec<[f64; 2]> =
            draws[i].iter().zip(&draws[j]).map(|(x, y)| [panel.x.share(*x), panel.y.share(*y)]).collect();
        contours(figure, panel, Density::of(&both, sampled.effective(), [[0.0, 1.0]; 2]).as_ref());
    };
    let mut figure = corner.draw("corner", diagonal, pair, &legend);
    let injected = if corner.truth.iter().any(Option::is_some) { "; dashed: injected values" } else { "" };
    figure.caption = format!(
        "Posterior of the sampled parameters after the burn-in: histograms with the 68 % interval shaded, numbers are \
        median and \
         68 % interval (\"unconstrained\": the data hardly say more than the prior); contours hold 68 and 95 % of the \
         draws{injected}."
    );
    figure
}

/// Bins of a histogram.
const BINS: usize = 40;

/// The histogram of draws, with their 68 % interval shaded where they have one.
fn histogram(figure: &mut Figure, frame: Rect, x: Axis, draws: &[f64], ci68: Option<[f64; 2]>) {
    let [low, high] = x.range;
    let mut counts = vec![0.0_f64; BINS];
    for draw in draws.iter().filter(|draw| (low..=high).contains(*draw)) {
        counts[((x.share(*draw) * BINS as f64) as usize).min(BINS - 1)] += 1.0;
    }
    let highest = counts.iter().fold(1.0_f64, |a, b| a.max(*b));
    let panel = Panel { frame, x, y: Axis::linear("", [0.0, 1.12 * highest]) };
    let edge = |k: usize| panel.x.value(k as f64 / BINS as f64);
    let steps: Vec<[f64; 2]> = (0..BINS).flat_map(|k| [[edge(k), counts[k]], [edge(k + 1), counts[k]]]).collect();
    let shaded = |from: f64, to: f64| {
        let inside = steps.iter().map(|[x, y]| [x.clamp(from, to), *y]);
        [[from, 0.0]].into_iter().chain(inside).chain([[to, 0.0]]).collect::<Vec<_>>()
    };
    panel.area(figure, "histogram", &shaded(low, high), Paint::fill(area_colours()[0]));
    if let Some([from, to]) = ci68 {
        let interval = shaded(from.clamp(low, high), to.clamp(low, high));
        panel.area(figure, "interval68", &interval, Paint::fill(area_colours()[1]));
    }
    panel.line(figure, "histogram", &steps, Stroke::new(BLACK, 0.6));
}

/// Contours of a density over fractions of the panel as filled areas.
fn contours(figure: &mut Figure, panel: &Panel, density: Option<&Density>) {
    let Some(density) = density else { return };
    for (share, (class, colour)) in
        SHARES.into_iter().zip([("area95", area_colours()[0]), ("area68", area_colours()[1])])
    {
        let lines = density.outlines(share);
        let frame = panel.frame;
        let place = |p: &[f64; 2]| [frame.left + p[0] * frame.width, frame.bottom() - p[1] * frame.height];
        let places = |line: &Vec<[f64; 2]>| line.iter().map(place).collect::<Vec<_>>();
        let path: Vec<Segment> = lines.iter().flat_map(|line| closed(&places(line))).collect();
        let paint = Paint { fill: Some(colour), stroke: Some(Stroke::new(BLUE, 0.7)), sharp: false };
        panel.clipped(figure, |figure| {
            if class == "area68" {
                // the inner area has a different colour
                figure.path("area68-ground", path.clone(), Paint::fill(WHITE));
            }
            figure.path(class, path, paint);
        });
    }
}
