//! Line profiles below each other in the order of their rotation phase, observed and modelled.

use super::ephemeris::ephemeris;
use super::{ANY, PlotError};
use crate::data::io::csv::{Columns, DATA_SET};
use crate::data::io::lsd;
use crate::data::io::map::{FIT, FitFile, UNCHANGING};
use crate::data::io::truth::{self, TruthFile};
use crate::figures::drawing::colour::{BLACK, GREY, PURPLE, VERMILION};
use crate::figures::drawing::{Align, Axis, Figure, Font, Key, Legend, PAGE_MM, Panel, Rect, Stroke};
use crate::runs::origin;
use std::path::Path;

/// The table of profiles by `map`.
pub(super) const FILE: &str = "profiles.csv";

/// A profile.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Line {
    pub time_d: f64,
    pub cycle: f64,
    pub velocity_kms: Vec<f64>,
    pub observed: Vec<f64>,
    pub sigma: Vec<f64>,
    /// Empty without a model.
    pub model: Vec<f64>,
    /// The model with static spots in addition to the evolving ones; empty without.
    pub unchanging: Vec<f64>,
    /// Number of its data set, if there are several.
    pub data_set: Option<usize>,
    /// Factor on its uncertainties, where the others do not predict it.
    pub sigma_factor: Option<f64>,
}

impl Line {
    /// Rotation phase, in [0, 1).
    pub fn phase(&self) -> f64 {
        self.cycle.rem_euclid(1.0) % 1.0
    }
}

/// The profiles of a map, in the order of their phase.
pub(super) fn read(folder: &Path) -> Result<Vec<Line>, PlotError> {
    let table = Columns::read(&folder.join(FILE))?;
    let mut events = Vec::new();
    if folder.join(FIT).is_file() {
        let fit: FitFile = origin::read(folder, FIT)?;
        table.check_rows(fit.summary.data, &format!("the data, by {FIT}"))?;
        events = fit.provenance.measured.events.map(|events| events.profiles).unwrap_or_default();
    }
    let numbers = table.column("profile")?;
    let [cycle, velocity] = [table.column_within("cycle", ANY)?, table.column_within("velocity_kms", ANY)?];
    let observed = table.column_within("observed", ANY)?;
    let [sigma, model] = [table.column("sigma")?, table.column("model")?];
    let (time_d, unchanging) = (table.column_within("time_d", ANY)?, table.column(UNCHANGING).ok());
    let data_set = table.column(DATA_SET).ok();
    let mut lines: Vec<Line> = Vec::new();
    for k in 0..numbers.len() {
        if k == 0 || numbers[k] != numbers[k - 1] {
            let data_set = data_set.map(|of| of[k] as usize);
            let event = events.iter().find(|event| event.profile as f64 == numbers[k] + 1.0);
            let sigma_factor = event.map(|event| event.sigma_factor);
            lines.push(Line { time_d: time_d[k], cycle: cycle[k], data_set, sigma_factor, ..Line::default() });
        }
        let line = lines.last_mut().expect("the first row begins a profile");
        line.velocity_kms.push(velocity[k]);
        line.observed.push(observed[k]);
        line.sigma.push(sigma[k]);
        line.model.push(model[k]);
        line.unchanging.extend(unchanging.map(|unchanging| unchanging[k]));
    }
    sorted(lines, &folder.join(FILE))
}

/// The profiles of a simulation, in the order of their phase.
pub(super) fn simulated(folder: &Path) -> Result<Vec<Line>, PlotError> {
    let truth: TruthFile = origin::read(folder, truth::FILE)?;
    let (period, epoch) = ephemeris(&truth.provenance().config).unwrap_or((1.0, 0.0));
    let list = folder.join("observations.txt");
    let observations = lsd::read_written(&list)?.observations;
    let line = |profile: &crate::star::observation::Profile| Line {
        time_d: profile.time_d,
        cycle: (profile.time_d - epoch) / period,
        velocity_kms: (0..profile.intensity.len()).map(|j| profile.velocity_kms(j)).collect(),
        observed: profile.intensity.clone(),
        sigma: profile.sigma.clone(),
        model: Vec::new(),
        unchanging: Vec::new(),
        data_set: None,
        sigma_factor: None,
    };
    sorted(observations.profiles.iter().map(line).collect(), &list)
}

fn sorted(mut lines: Vec<Line>, file: &Path) -> Result<Vec<Line>, PlotError> {
    if lines.is_empty() {
        return Err(PlotError::Content { path: file.into(), problem: "holds no profile".into() });
    }
    lines.sort_by(|a, b| a.phase().total_cmp(&b.phase()).then(a.cycle.total_cmp(&b.cycle)));
    Ok(lines)
}

/// The smallest and the largest of some numbers of all profiles.
pub(super) fn extent(lines: &[Line], numbers: impl Fn(&Line) -> &[f64]) -> [f64; 2] {
    let all = lines.iter().flat_map(|line| numbers(line).iter());
    all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)])
}

/// Space for the cycles beside the profiles (pt).
const LABELS: f64 = 42.0;

/// Profiles per column.
const PER_COLUMN: usize = 17;

/// The figure.
pub(super) fn figure(lines: &[Line]) -> Figure {
    let columns = lines.len().div_ceil(PER_COLUMN).clamp(1, 4);
    let rows = lines.len().div_ceil(columns);
    // as high as the profiles need, at most a page
    let height_mm = (28.0 + 11.0 * rows as f64).clamp(60.0, 225.0);
    let width_mm = if columns == 1 { crate::figures::drawing::COLUMN_MM } else { PAGE_MM };
    let mut figure = Figure::new("profiles", width_mm, height_mm);
    let modelled = lines.iter().any(|line| !line.model.is_empty());
    let what = if modelled { "Observed (black) and modelled (orange) line profiles" } else { "Line profiles" };
    figure.caption = format!(
        "{what} below each other in the order of their rotation phase; numbers are rotation cycles, whole turns + \
        phase. Bars \
         beside the profiles are plus and minus one standard error."
    );
    let eventful = lines.iter().any(|line| line.sigma_factor.is_some());
    if eventful {
        figure.caption += " Purple: profiles that the others do not predict; their errors are enlarged (bars).";
    }
    if lines.iter().any(|line| line.data_set.is_some()) {
        figure.caption += " In parentheses: the number of the data set.";
    }
    let [low, high] = extent(lines, |line| &line.observed);
    let spacing = 0.5 * (high - low);
    let (margin, top, bottom) = (15.0, 25.0, 30.0);
    let cell = figure.width / columns as f64;
    let legend_middle = figure.width / 2.0;
    let velocities = extent(lines, |line| &line.velocity_kms);
    for (column, lines) in lines.chunks(rows).enumerate() {
        let frame = Rect {
            left: margin + cell * column as f64,
            top,
            width: cell - margin - LABELS,
            height: figure.height - top - bottom,
        };
        // all columns share one scale
        let range = [low - spacing * (rows as f64 - 0.7), high + 0.5 * spacing];
        let room = velocities[1] - velocities[0];
        let x = Axis::linear("velocity (km/s)", [velocities[0] - 0.04 * room, velocities[1] + 0.04 * room]);
        let panel = Panel { frame, x, y: Axis::linear("", range) };
        for (row, line) in lines.iter().enumerate() {
            one(&mut figure, &panel, line, spacing * row as f64);
        }
        panel.bare_y_frame(&mut figure);
        figure.text("cycle + phase", [frame.right() + LABELS - 1.0, top - 3.0], TINY, Align::Right, 0.0);
        if column == 0 {
            let label = "intensity / continuum + offset";
            figure.text(label, [frame.left - 4.5, frame.centre()[1]], Font::LABEL, Align::Centre, 90.0);
            depth_bar(&mut figure, &panel, spacing);
        }
    }
    let mut legend = Legend::default();
    legend.add(Key::Line(OBSERVED), "observed");
    if modelled {
        legend.add(Key::Line(MODEL), "model");
        if eventful {
            legend.add(Key::Line(EVENT), "outlier");
        }
        legend.row(&mut figure, [legend_middle, 9.0]);
    }
    figure
}

const TINY: Font = Font { size: 6.0, ..Font::SMALL };

const OBSERVED: Stroke = Stroke::new(BLACK, 1.2);
const EVENT: Stroke = Stroke::new(PURPLE, 1.2);
const MODEL: Stroke = Stroke::new(VERMILION, 0.6);

/// One profile, shifted down by `down`.
fn one(figure: &mut Figure, panel: &Panel, line: &Line, down: f64) {
    let points = |y: &[f64]| line.velocity_kms.iter().zip(y).map(|(v, i)| [*v, i - down]).collect::<Vec<_>>();
    let observed = if line.sigma_factor.is_some() { EVENT } else { OBSERVED };
    panel.line(figure, "observed", &points(&line.observed), observed);
    panel.line(figure, "model", &points(&line.model), MODEL);
    let turns = line.cycle - line.phase();
    let (last, level) =
        (line.velocity_kms.last().copied().unwrap_or(0.0), line.observed.last().copied().unwrap_or(1.0));
    let middle = panel.place(last, level - down)[1];
    let bar = panel.frame.right() + 3.5;
    let sigma = line.sigma.iter().sum::<f64>() / line.sigma.len().max(1) as f64;
    let half = 0.5 * (panel.place(last, 0.0)[1] - panel.place(last, 2.0 * sigma)[1]);
    figure.polyline("sigma", &[[bar, middle - half], [bar, middle + half]], Stroke::new(BLACK, 1.0));
    // beside the number of a data set there is space for two digits
    let text = match line.data_set {
        None => format!("{turns:.0} + {:.3}", line.phase()),
        Some(set) => format!("{turns:.0} + {:.2} ({set})", line.phase()),
    };
    figure.text(&text, [bar + 3.0, middle + 2.3], TINY, Align::Left, 0.0);
}

/// A bar with the vertical scale in units of the continuum.
fn depth_bar(figure: &mut Figure, panel: &Panel, spacing: f64) {
    let power = 10f64.powf(spacing.log10().floor());
    let length = [5.0, 2.0, 1.0].into_iter().map(|f| f * power).find(|l| *l <= spacing * 1.001).unwrap_or(power);
    let foot = panel.frame.bottom() - 8.0;
    let head = foot - length / (panel.y.range[1] - panel.y.range[0]) * panel.frame.height;
    let x = panel.frame.left + 10.0;
    let pen = Stroke::new(GREY, 0.9);
    for line in [[[x, foot], [x, head]], [[x - 2.0, foot], [x + 2.0, foot]], [[x - 2.0, head], [x + 2.0, head]]] {
        figure.polyline("depth-bar", &line, pen);
    }
    let text = format!("{length} *I*_{{c}}");
    figure.text(&text, [x + 5.0, 0.5 * (foot + head) + 2.5], TINY, Align::Left, 0.0);
}
