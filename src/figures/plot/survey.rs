//! A sample of stars: the total completeness of all searches with the planets found, and the posterior of the rate of
//! planets.

use super::{POSITIVE, PlotError};
use crate::data::io::csv::Columns;
use crate::figures::drawing::colour::{ColourMap, GREY, SERIES, SKY, VERMILION, WHITE};
use crate::figures::drawing::panel::{Marker, Shade, Sides, Tile};
use crate::figures::drawing::{
    Align, Axis, Colour, Figure, Font, Key, Legend, PAGE_MM, Paint, Panel, Rect, Stroke, width_pt,
};
use crate::planets::speeds::Speeds;
use crate::runs::origin;
use crate::runs::survey::{COMPLETENESS, JSON, RateRecord, Size, StarRecord, SurveyFile};
use std::path::Path;

/// The figures.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let file: SurveyFile = origin::read(folder, JSON)?;
    let path = folder.join(COMPLETENESS);
    let mut figures = Vec::new();
    if file.stars.iter().any(|star| star.counted) {
        let table = Columns::read(&path)?;
        for size in [Size::Amplitude, Size::Mass] {
            figures.extend(map(&file, &table, size)?);
        }
    }
    figures.push(rates(&file));
    Ok(figures)
}

/// The sum over all stars at periods and sizes: rising values of both, and the sum, period after period.
struct Sum {
    periods: Vec<f64>,
    sizes: Vec<f64>,
    stars: Vec<f64>,
}

impl Sum {
    /// `None` where the table has none for that size.
    fn read(table: &Columns, size: Size) -> Result<Option<Sum>, PlotError> {
        let (star, period) = (table.column("star")?, table.column_within("period_d", POSITIVE)?);
        let (k, mass, stars) = (table.column("k_kms")?, table.column("msini_mjup")?, table.column("completeness")?);
        let values = if size == Size::Amplitude { k } else { mass };
        let is_of = |j: &usize| star[*j] == 0.0 && values[*j] > 0.0 && (size == Size::Amplitude || k[*j].is_nan());
        let rows: Vec<usize> = (0..star.len()).filter(is_of).collect();
        let distinct = |of: &[f64]| {
            let mut all: Vec<f64> = rows.iter().map(|j| of[*j]).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        };
        let sum =
            Sum { periods: distinct(period), sizes: distinct(values), stars: rows.iter().map(|j| stars[*j]).collect() };
        let is_whole = sum.periods.len() > 1 && sum.sizes.len() > 1;
        Ok((is_whole && sum.stars.len() == sum.periods.len() * sum.sizes.len()).then_some(sum))
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.stars[i * self.sizes.len() + j]
    }

    /// The size above which the sum stays at `level` or above, at each period.
    fn reached(&self, level: f64) -> Vec<[f64; 2]> {
        let at = |i: usize| {
            let below = (0..self.sizes.len()).rposition(|j| self.at(i, j) < level);
            match below {
                None => self.sizes[0],
                Some(j) if j + 1 == self.sizes.len() => f64::NAN,
                Some(j) => {
                    let along = (level - self.at(i, j)) / (self.at(i, j + 1) - self.at(i, j));
                    self.sizes[j] * (self.sizes[j + 1] / self.sizes[j]).powf(along)
                }
            }
        };
        (0..self.periods.len()).map(|i| [self.periods[i], at(i)]).collect()
    }
}

/// The map of completeness by one size.
fn map(file: &SurveyFile, table: &Columns, size: Size) -> Result<Option<Figure>, PlotError> {
    let Some(sum) = Sum::read(table, size)? else { return Ok(None) };
    let counted = file.stars.iter().filter(|star| star.counted).count() as f64;
    let name = if size == Size::Amplitude { "completeness" } else { "completeness_mass" };
    let mut figure = Figure::new(name, PAGE_MM, 96.0);
    figure.caption = MAP.into();
    let (left, top) = (40.0, 12.0);
    let frame = Rect { left, top, width: figure.width - left - 56.0, height: figure.height - top - 48.0 };
    let unit = Speeds::of(&sum.sizes);
    let (factor, label) = match size {
        Size::Amplitude => (unit.factor, format!("*K* ({})", unit.name)),
        Size::Mass => (1.0, "*M* sin *i* (*M*_{Jup})".to_owned()),
    };
    let step = |of: &[f64]| (of[of.len() - 1] / of[0]).powf(0.5 / (of.len() - 1) as f64);
    let (across, up) = (step(&sum.periods), step(&sum.sizes));
    let found: Vec<(&StarRecord, [f64; 2], f64)> =
        file.stars.iter().filter_map(|star| signal(file, star, size)).collect();
    let ends = |of: &[f64], step: f64, also: &mut dyn Iterator<Item = f64>| {
        let whole = [of[0] / step, of[of.len() - 1] * step];
        // the range includes signals beyond the injected one
        let beyond = also.filter(|x| *x > 0.0 && !(whole[0]..=whole[1]).contains(x));
        beyond.fold(whole, |[low, high], x| [low.min(x / 1.2), high.max(1.2 * x)])
    };
    let periods = ends(&sum.periods, across, &mut found.iter().map(|(_, at, _)| at[0]));
    let sizes = ends(&sum.sizes, up, &mut found.iter().map(|(_, at, _)| at[1])).map(|x| factor * x);
    let panel = Panel { frame, x: Axis::log("period (d)", periods), y: Axis::log(&label, sizes) };
    let shade = Shade { map: ColourMap::Cividis, low: 0.0, high: 100.0 };
    let tile = |i: usize, j: usize| Tile {
        x: [sum.periods[i] / across, sum.periods[i] * across],
        y: [factor * sum.sizes[j] / up, factor * sum.sizes[j] * up],
        value: 100.0 * sum.at(i, j) / counted,
    };
    let all = (0..sum.periods.len()).flat_map(|i| (0..sum.sizes.len()).map(move |j| (i, j)));
    panel.tiles(&mut figure, all.map(|(i, j)| tile(i, j)), shade);
    let (half, nearly_all) = (Stroke::new(WHITE, 1.2).dashed(), Stroke::new(VERMILION, 1.2));
    for (share, pen, class) in [(0.5, half, "half"), (0.95, nearly_all, "nearly-all")] {
        let line: Vec<[f64; 2]> = sum.reached(share * counted).iter().map(|[x, y]| [*x, factor * y]).collect();
        panel.line(&mut figure, class, &line, pen);
    }
    let box_pen = Stroke::new(SKY, 1.1);
    let mut has_box = false;
    for planets in &file.boxes {
        let sizes = if size == Size::Amplitude { planets.k_kms } else { planets.msini_mjup };
        if let Some([low, high]) = sizes.map(|sizes| sizes.map(|x| factor * x)) {
            let [first, last] = planets.period_d;
            let corners = [[first, low], [last, low], [last, high], [first, high]];
            panel.area(&mut figure, "box", &corners, Paint::stroke(box_pen));
            has_box = true;
        }
    }
    signals(&mut figure, &panel, &found, factor);
    panel.frame(&mut figure, Sides::BOTH);
    shade.upright_bar(&mut figure, frame, &format!("completeness (% of {counted} stars)"));
    let mut legend = Legend::default();
    legend.add(Key::Line(Stroke { colour: GREY, ..half }), "50 %");
    legend.add(Key::Line(nearly_all), "95 %");
    if has_box {
        legend.add(Key::Line(box_pen), "box");
    }
    if !found.is_empty() {
        legend.add(Key::Point(Marker::Diamond, VERMILION), "signals with FAP < 1 %");
    }
    legend.row(&mut figure, [frame.centre()[0], frame.bottom() + 37.0]);
    Ok(Some(figure))
}

/// The signal of a counted star: period, size, and the uncertainty of the size.
fn signal<'a>(file: &SurveyFile, star: &'a StarRecord, size: Size) -> Option<(&'a StarRecord, [f64; 2], f64)> {
    let chance = star.false_alarm_probability.filter(|p| star.counted && *p < file.false_alarm_probability);
    chance?;
    let (period, k, sigma) = (star.period_d?, star.k_kms?, star.sigma_k_kms.unwrap_or(0.0));
    match size {
        Size::Amplitude => Some((star, [period, k], sigma)),
        Size::Mass => Some((star, [period, star.msini_mjup?], star.msini_mjup? * sigma / k)),
    }
}

/// Points with error bars, and the names of their stars where there is space.
fn signals(figure: &mut Figure, panel: &Panel, found: &[(&StarRecord, [f64; 2], f64)], factor: f64) {
    let mut taken: Vec<Rect> = Vec::new();
    for (_, [x, y], sigma) in found {
        let [low, high] = [(y - sigma).max(0.05 * y), y + sigma].map(|y| factor * y);
        panel.bar(figure, "signal", [[*x, low], [*x, high]], 0.0, Stroke::new(WHITE, 1.0));
        for (size, colour) in [(8.0, WHITE), (6.0, VERMILION)] {
            panel.points(figure, "signal", &[[*x, factor * y]], (Marker::Diamond, size, colour));
        }
        let [x, y] = panel.place(*x, factor * y);
        taken.push(Rect { left: x - 4.0, top: y - 4.0, width: 8.0, height: 8.0 });
    }
    for (star, [x, y], _) in found {
        let [x, y] = panel.place(*x, factor * y);
        let width = width_pt(&star.name, Font::SMALL.size);
        let places = [x + 6.0, x - 6.0 - width].map(|left| Rect { left, top: y - 4.0, width, height: 8.0 });
        let is_free = |place: &&Rect| {
            let inside = place.left > panel.frame.left && place.right() < panel.frame.right();
            inside && taken.iter().all(|other| !overlap(place, other))
        };
        if let Some(place) = places.iter().find(is_free) {
            let baseline = [place.left, place.top + 6.5];
            figure.rect("label-ground", *place, Paint::fill(WHITE.opacity(0.7)));
            figure.text(&star.name, baseline, Font::SMALL, Align::Left, 0.0);
            taken.push(*place);
        }
    }
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a.left < b.right() && b.left < a.right() && a.top < b.bottom() && b.top < a.bottom()
}

/// Most panels in a row.
const COLUMNS: usize = 2;

/// The posterior of each rate, one panel per box and one colour per group.
fn rates(file: &SurveyFile) -> Figure {
    let boxes = file.boxes.len().max(1);
    let (columns, rows) = (boxes.min(COLUMNS), boxes.div_ceil(COLUMNS));
    let (left, top, gap, below) = (40.0, 18.0, 44.0, 34.0);
    let height = if columns == 1 { 150.0 } else { 120.0 };
    let mut figure = Figure::new("rates", PAGE_MM, rows as f64 * (height + top + below) / 72.0 * 25.4);
    figure.caption = RATES.into();
    let width = (figure.width - left - 12.0 - gap * (columns - 1) as f64) / columns as f64;
    for (k, planets) in file.boxes.iter().enumerate() {
        let frame = Rect {
            left: left + (k % columns) as f64 * (width + gap),
            top: top + (k / columns) as f64 * (height + top + below),
            width,
            height,
        };
        let of_box: Vec<&RateRecord> = file.rates.iter().filter(|rate| rate.planets == k + 1).collect();
        posterior(&mut figure, frame, &of_box);
        let words = planets.planets().words().replace("M_Jup", "*M*_{Jup}").replace("M sin i", "*M* sin *i*");
        let words = words.replace("P ", "*P* ").replace("K ", "*K* ");
        figure.text(&words, [frame.centre()[0], frame.top - 5.0], Font::SMALL, Align::Centre, 0.0);
    }
    figure
}

/// Posteriors of one box.
fn posterior(figure: &mut Figure, frame: Rect, rates: &[&RateRecord]) {
    let end = rates.iter().map(|rate| 100.0 * rate.ci95[1]).fold(1.0, f64::max);
    let range = [0.0, (1.35 * end).min(100.0)];
    let inside = |rate: &RateRecord| -> Vec<[f64; 2]> {
        // per cent on the axis: the density is per per cent, too
        let all = rate.rate.iter().zip(&rate.density).map(|(x, y)| [100.0 * x, 0.01 * y]);
        all.filter(|[x, y]| *x <= range[1] && y.is_finite()).collect()
    };
    // with an unbounded density at 0 the curve leaves the panel there
    let height = |rate: &RateRecord| {
        inside(rate).iter().filter(|[x, _]| *x > 0.01 * range[1]).map(|[_, y]| *y).fold(0.0, f64::max)
    };
    let highest = rates.iter().map(|rate| height(rate)).fold(0.0, f64::max);
    // above all curves, for the legend
    let room = 1.1 + 12.0 * rates.len() as f64 / frame.height;
    let panel = Panel {
        frame,
        x: Axis::linear("stars with a planet (%)", range),
        y: Axis::linear("probability density (1/%)", [0.0, room * if highest > 0.0 { highest } else { 1.0 }]),
    };
    let mut legend = Legend::default();
    for (k, rate) in rates.iter().enumerate() {
        let colour: Colour = SERIES[k % SERIES.len()];
        let line = inside(rate);
        let [low, high] = rate.ci68.map(|x| 100.0 * x);
        let within: Vec<[f64; 2]> = line.iter().copied().filter(|[x, _]| (low..=high).contains(x)).collect();
        if let (Some(first), Some(last)) = (within.first(), within.last()) {
            let corners: Vec<[f64; 2]> =
                std::iter::once([first[0], 0.0]).chain(within.iter().copied()).chain([[last[0], 0.0]]).collect();
            panel.area(
                figure,
                "ci68",
                &corners,
                Paint::fill(colour.opacity(if rates.len() > 1 { 0.15 } else { 0.25 })),
            );
        }
        panel.line(figure, "rate", &line, Stroke::new(colour, 1.2));
        let ends = rate.ci95.map(|x| 100.0 * x).into_iter().filter(|x| *x > 0.0);
        ends.for_each(|x| panel.vertical(figure, "ci95", x, Stroke::new(colour, 0.8).dotted()));
        let of = rate.group.as_deref().unwrap_or("all");
        let found = match rate.upper95 {
            Some(upper) => format!("< {:.1} % (95 %)", 100.0 * upper),
            None => format!("{:.1} % ({low:.1} to {high:.1} %)", 100.0 * rate.most_likely),
        };
        legend.add(Key::Line(Stroke::new(colour, 1.2)), &format!("{of}, {} stars: {found}", rate.stars));
    }
    panel.frame(figure, Sides::BOTH);
    legend.draw(figure, frame, [1.0, 0.0]);
}

const MAP: &str = "Completeness of a survey: share of the stars around which a planet of that period and size would be \
recovered (FAP < 1 %, right period), by injections into the profiles of each. Lines: sizes from which on it is 50 and \
95 %. Diamonds: signals with FAP < 1 %, and their stars. Frames: boxes whose rate of planets is estimated.";

const RATES: &str = "Rate of planets: posterior of the fraction of stars with a planet in a box of period and size, \
given the completeness of each star and the probability that each signal is a false alarm. Shaded: 68 % credible \
interval; dotted: 95 %.";
