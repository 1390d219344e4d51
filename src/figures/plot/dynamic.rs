//! The dynamic spectrum: the changes of the profiles with rotation phase, observed and modelled, and the residuals.

use super::profiles::{Line, extent};
use crate::figures::drawing::colour::{ColourMap, GREY};
use crate::figures::drawing::panel::{Shade, Sides, Tile};
use crate::figures::drawing::{Align, Axis, Figure, Font, PAGE_MM, Paint, Panel, Rect};

/// Largest half-height of a profile in phase.
const HALF_ROW: f64 = 0.015;

/// Residual at the end of the colour scale (standard errors).
const RESIDUAL: f64 = 4.0;

/// The figure of profiles with a model, which are in the order of their phase.
pub(super) fn figure(lines: &[Line]) -> Figure {
    let mut figure = Figure::new("residuals", PAGE_MM, 92.0);
    figure.caption =
        "Dynamic spectra: observed and modelled profiles minus the mean observed profile (of its data set), and \
        residuals in units of the uncertainty. Rows are profiles at their rotation phases; phases that were not \
        observed are grey."
            .into();
    let means: Vec<Vec<f64>> = lines.iter().map(|line| mean(lines, line)).collect();
    let largest = lines
        .iter()
        .zip(&means)
        .flat_map(|(line, mean)| line.observed.iter().zip(mean).map(|(x, mean)| 100.0 * (x - mean).abs()))
        .filter(|x| x.is_finite())
        .fold(0.0, f64::max);
    // with identical profiles, zero is in the middle, too
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let change = Shade { map: ColourMap::Diverging, low: -largest, high: largest };
    let left_over = Shade { map: ColourMap::Diverging, low: -RESIDUAL, high: RESIDUAL };
    let velocities = extent(lines, |line| &line.velocity_kms);
    let (left, gap, bar) = (36.0, 12.0, 52.0);
    let width = (figure.width - left - gap - 2.0 * bar) / 3.0;
    type Value<'a> = &'a dyn Fn(&Line, &[f64], usize) -> f64;
    let panels: [(&str, Value, Shade, f64); 3] = [
        ("observed − mean", &|line, mean, k| 100.0 * (line.observed[k] - mean[k]), change, left),
        ("model − mean", &|line, mean, k| 100.0 * (line.model[k] - mean[k]), change, left + width + gap),
        (
            "observed − model",
            &|line, _, k| (line.observed[k] - line.model[k]) / line.sigma[k],
            left_over,
            left + 2.0 * width + gap + bar,
        ),
    ];
    for (k, (title, value, shade, left)) in panels.into_iter().enumerate() {
        let frame = Rect { left, top: 16.0, width, height: figure.height - 46.0 };
        let y = Axis::linear(if k == 0 { "rotation phase" } else { "" }, [0.0, 1.0]);
        let panel = Panel { frame, x: Axis::linear("velocity (km/s)", velocities), y };
        let tiles = lines.iter().zip(&means).zip(rows(lines)).flat_map(|((line, mean), rows)| {
            let edges = edges(&line.velocity_kms);
            rows.into_iter().flat_map(move |y| {
                let edges = edges.clone();
                (0..line.velocity_kms.len()).map(move |k| Tile {
                    x: [edges[k], edges[k + 1]],
                    y,
                    value: value(line, mean, k),
                })
            })
        });
        figure.rect("not-observed", frame, Paint::fill(GREY.opacity(0.35)));
        panel.tiles(&mut figure, tiles, shade);
        panel.narrow_frame(&mut figure, Sides { below: true, left: k == 0 });
        figure.text(title, [frame.centre()[0], 10.0], Font::LABEL, Align::Centre, 0.0);
        match k {
            1 => shade.upright_bar(&mut figure, frame, "% of the continuum"),
            2 => shade.upright_bar(&mut figure, frame, "uncertainties (σ)"),
            _ => {}
        }
    }
    figure
}

/// Mean observed profile of the data set of `own` in its bins. Profiles whose bins are offset, because a different
/// velocity was subtracted from each, are interpolated linearly.
fn mean(lines: &[Line], own: &Line) -> Vec<f64> {
    let of_set: Vec<&Line> = lines.iter().filter(|line| line.data_set == own.data_set).collect();
    let mean = |k: usize| {
        let there = of_set.iter().filter_map(|line| match line.velocity_kms == own.velocity_kms {
            true => Some(line.observed[k]),
            false => observed_at(line, own.velocity_kms[k]),
        });
        let (sum, count) = there.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
        sum / count
    };
    (0..own.observed.len()).map(mean).collect()
}

/// The value of a profile at a velocity (km/s); `None` beyond its bins.
fn observed_at(line: &Line, velocity_kms: f64) -> Option<f64> {
    let above = line.velocity_kms.partition_point(|v| *v < velocity_kms);
    if line.velocity_kms.get(above) == Some(&velocity_kms) {
        return Some(line.observed[above]);
    }
    let below = above.checked_sub(1)?;
    let [from, to] = [line.velocity_kms[below], *line.velocity_kms.get(above)?];
    let part = (velocity_kms - from) / (to - from);
    Some(line.observed[below] + part * (line.observed[above] - line.observed[below]))
}

/// Borders of bins around their centres.
pub(super) fn edges(centres: &[f64]) -> Vec<f64> {
    let step = if centres.len() > 1 { centres[1] - centres[0] } else { 1.0 };
    let first = centres.first().map(|v| v - 0.5 * step);
    first.into_iter().chain(centres.iter().map(|v| v + 0.5 * step)).collect()
}

/// The phase ranges in which each profile is drawn: half way to its neighbours, at most [`HALF_ROW`]; in two parts
/// around 0.
fn rows(lines: &[Line]) -> Vec<Vec<[f64; 2]>> {
    let phases: Vec<f64> = lines.iter().map(Line::phase).collect();
    let n = phases.len();
    let half = |from: f64, to: f64| (0.5 * (to - from).rem_euclid(1.0)).min(HALF_ROW);
    let row = |k: usize| {
        let phase = phases[k];
        let (before, after) = (phases[(k + n - 1) % n], phases[(k + 1) % n]);
        // one profile alone has no neighbours
        let (down, up) = if n == 1 { (HALF_ROW, HALF_ROW) } else { (half(before, phase), half(phase, after)) };
        let (low, high) = (phase - down, phase + up);
        match (low < 0.0, high > 1.0) {
            (true, _) => vec![[0.0, high], [1.0 + low, 1.0]],
            (_, true) => vec![[low, 1.0], [0.0, high - 1.0]],
            _ => vec![[low, high]],
        }
    };
    (0..n).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A constant line shows no change, whatever the positions of its bins: `1 - v^2` is that of all profiles.
    #[test]
    fn the_mean_is_of_all_profiles_of_a_set() {
        let line = |shift: f64, data_set: usize| {
            let velocity_kms: Vec<f64> = (0..41).map(|j| -2.0 + 0.1 * f64::from(j) + shift).collect();
            let observed = velocity_kms.iter().map(|v| 1.0 - v * v - data_set as f64).collect();
            Line { velocity_kms, observed, data_set: Some(data_set), ..Line::default() }
        };
        let lines = [line(0.0, 1), line(0.03, 1), line(-0.05, 1), line(0.0, 2)];
        for own in &lines {
            let change = mean(&lines, own).into_iter().zip(&own.observed).map(|(mean, x)| (x - mean).abs());
            assert!(change.fold(0.0, f64::max) < 0.01);
        }
        assert_eq!(mean(&lines[..2], &lines[0])[0], lines[0].observed[0]);
        let changed = Line { observed: vec![1.0; 41], ..line(0.03, 1) };
        let lines = [line(0.0, 1), changed];
        let change = (mean(&lines, &lines[0])[10] - lines[0].observed[10]).abs();
        // at -1 km/s one has -1, the other 1
        assert!((change - 1.0).abs() < 0.05, "{change}");
    }

    #[test]
    fn rows_meet_half_way_and_go_around() {
        let at = |cycle: f64| Line { cycle, ..Line::default() };
        let rows = rows(&[at(0.005), at(2.025), at(1.5)]);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(close(rows[0][0][0], 0.0) && close(rows[0][0][1], 0.015) && close(rows[0][1][0], 0.99));
        assert!(close(rows[1][0][0], 0.015) && close(rows[1][0][1], 0.04));
        assert!(close(rows[2][0][0], 0.485) && close(rows[2][0][1], 0.515));
    }
}
