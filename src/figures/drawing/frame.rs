//! Frames of panels: ticks on all sides, numbers and labels below and to the left; and colour bars.

use super::colour::BLACK;
use super::panel::{Panel, Scale, Shade, Sides};
use super::ticks::{Ticks, ticks};
use super::{Align, Axis, Figure, Font, LABEL_PT, Paint, Rect, SMALL_PT, Segment, Stroke, width_pt};

/// Length of a tick with a number (pt).
const MAJOR: f64 = 3.0;
/// Length of a tick without a number (pt).
const MINOR: f64 = 1.6;
/// The pen of frames.
const PEN: Stroke = Stroke::new(BLACK, 0.6);
/// Gap between a frame and its numbers (pt).
const GAP: f64 = 3.0;
/// Height of a capital over its size.
const CAPITAL: f64 = 0.71;

/// Number of labels that fit along a side.
fn most(length: f64, apart: f64) -> usize {
    ((length / apart) as usize).clamp(2, 8)
}

/// Smallest distance between the ends of two numbers (pt).
const APART: f64 = 4.0;

/// The space for numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Room {
    /// At every tick.
    Free,
    /// Within the width of the panel: adjacent panels to its sides have numbers there.
    OwnWidth,
    /// Within its width and height.
    Own,
}

/// Ticks along x; numbers without `room` are omitted.
fn x_ticks(frame: Rect, axis: &Axis, room: Room) -> Ticks {
    let half = |text: &str| 0.5 * width_pt(text, SMALL_PT);
    let at = |value: f64| axis.share(value) * frame.width;
    let shown = |found: Ticks| match room {
        Room::Free => found,
        Room::OwnWidth | Room::Own => {
            found.with(|value, text| at(value) >= half(text) && at(value) + half(text) <= frame.width)
        }
    };
    // numbers must not touch: fewer of them where they are long
    let fits = |found: &Ticks| {
        let mut ends: Vec<[f64; 2]> =
            found.major.iter().map(|(value, text)| [at(*value) - half(text), at(*value) + half(text)]).collect();
        ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let apart = if axis.scale == Scale::Linear { 1.5 * APART } else { APART };
        ends.windows(2).all(|pair| pair[0][1] + apart <= pair[1][0])
    };
    let tried = (1..=most(frame.width, 14.0)).rev().map(|n| shown(ticks(axis.range, axis.scale, n)));
    let fitting: Vec<Ticks> = tried.filter(fits).collect();
    let best = fitting.iter().position(|found| found.major.len() >= 2).unwrap_or(0);
    fitting.into_iter().nth(best).unwrap_or_else(|| ticks(axis.range, axis.scale, 1).with(|_, _| false))
}

fn y_ticks(frame: Rect, axis: &Axis, room: Room) -> Ticks {
    let first = most(frame.height, 16.0);
    let half = 0.5 * CAPITAL * SMALL_PT;
    let at = |value: f64| axis.share(value) * frame.height;
    let shown = |found: Ticks| match room {
        Room::Free | Room::OwnWidth => found,
        Room::Own => found.with(|value, _| at(value) >= half && at(value) + half <= frame.height),
    };
    // one number alone gives no scale: then at smaller distances, as long as there is room
    let closest = ((frame.height / 9.0) as usize).max(first);
    let tried = (first..=closest).map(|n| shown(ticks(axis.range, axis.scale, n))).find(|found| found.major.len() >= 3);
    tried.unwrap_or_else(|| shown(ticks(axis.range, axis.scale, first)))
}

impl Panel {
    /// Frame, ticks, numbers and labels; after the data, so that nothing covers them.
    pub fn frame(&self, figure: &mut Figure, sides: Sides) {
        draw(self, figure, sides, Room::Free);
    }

    /// The same with adjacent panels: no number leaves the width or height of the panel, so that those of neighbours
    /// cannot touch.
    pub fn close_frame(&self, figure: &mut Figure, sides: Sides) {
        draw(self, figure, sides, Room::Own);
    }

    /// The same with adjacent panels only to its sides.
    pub fn narrow_frame(&self, figure: &mut Figure, sides: Sides) {
        draw(self, figure, sides, Room::OwnWidth);
    }

    /// The same with another axis along the upper side; its numbers and label only if `labelled`.
    pub fn two_axes_frame(&self, figure: &mut Figure, sides: Sides, upper: &Axis, labelled: bool) {
        let y = y_ticks(self.frame, &self.y, Room::OwnWidth);
        draw_with(self, figure, sides, &y, Room::OwnWidth, Some((upper, labelled)));
    }

    /// The same without ticks on its sides, where heights are only relative.
    pub fn bare_y_frame(&self, figure: &mut Figure) {
        draw_without_y(self, figure, Sides::BOTH, Room::Own);
    }

    /// The same without numbers.
    pub fn bare_frame(&self, figure: &mut Figure) {
        draw_without_y(self, figure, Sides { below: false, left: false }, Room::Own);
    }
}

/// The frame of a panel.
fn draw(panel: &Panel, figure: &mut Figure, sides: Sides, room: Room) {
    let y = y_ticks(panel.frame, &panel.y, room);
    draw_with(panel, figure, sides, &y, room, None);
}

/// The frame of a panel without ticks on its sides.
fn draw_without_y(panel: &Panel, figure: &mut Figure, sides: Sides, room: Room) {
    draw_with(panel, figure, sides, &Ticks::default(), room, None);
}

/// The frame with ticks `y` on its sides and, where there is one, an axis along its upper side (its numbers and label
/// only if asked for).
fn draw_with(panel: &Panel, figure: &mut Figure, sides: Sides, y: &Ticks, room: Room, upper: Option<(&Axis, bool)>) {
    let frame = panel.frame;
    let x = x_ticks(frame, &panel.x, room);
    let above = upper.map(|(axis, _)| (axis, x_ticks(frame, axis, room)));
    let mut path = Vec::new();
    let mut tick = |from: [f64; 2], by: [f64; 2]| {
        path.extend([Segment::Move(from), Segment::Line([from[0] + by[0], from[1] + by[1]])]);
    };
    for (length, values) in lengths(&x) {
        for value in values {
            let at = frame.left + panel.x.share(value) * frame.width;
            tick([at, frame.bottom()], [0.0, -length]);
            if above.is_none() {
                tick([at, frame.top], [0.0, length]);
            }
        }
    }
    if let Some((axis, ticks)) = &above {
        for (length, values) in lengths(ticks) {
            for value in values {
                tick([frame.left + axis.share(value) * frame.width, frame.top], [0.0, length]);
            }
        }
    }
    for (length, values) in lengths(y) {
        for value in values {
            let at = frame.bottom() - panel.y.share(value) * frame.height;
            tick([frame.left, at], [length, 0.0]);
            tick([frame.right(), at], [-length, 0.0]);
        }
    }
    figure.path("ticks", path, Paint::stroke(PEN));
    figure.rect("frame", frame, Paint::stroke(PEN));
    if sides.below {
        numbers_below(figure, frame, &panel.x, &x);
    }
    if let (Some((axis, ticks)), Some((_, true))) = (&above, upper) {
        numbers_above(figure, frame, axis, ticks);
    }
    if sides.left {
        numbers_left(figure, frame, &panel.y, y);
    }
}

/// Lengths of ticks, each with the values of its ticks.
fn lengths(ticks: &Ticks) -> [(f64, Vec<f64>); 2] {
    let major = ticks.major.iter().map(|(value, _)| *value).chain(ticks.silent.iter().copied());
    [(MAJOR, major.collect()), (MINOR, ticks.minor.clone())]
}

fn numbers_below(figure: &mut Figure, frame: Rect, axis: &Axis, ticks: &Ticks) {
    let baseline = frame.bottom() + GAP + CAPITAL * SMALL_PT;
    for (value, text) in &ticks.major {
        let at = frame.left + axis.share(*value) * frame.width;
        figure.text(text, [at, baseline], Font::SMALL, Align::Centre, 0.0);
    }
    let at = [frame.centre()[0], baseline + GAP + LABEL_PT];
    figure.text(&axis.label, at, Font::LABEL, Align::Centre, 0.0);
}

fn numbers_above(figure: &mut Figure, frame: Rect, axis: &Axis, ticks: &Ticks) {
    for (value, text) in &ticks.major {
        let at = frame.left + axis.share(*value) * frame.width;
        figure.text(text, [at, frame.top - GAP], Font::SMALL, Align::Centre, 0.0);
    }
    let at = [frame.centre()[0], frame.top - 2.0 * GAP - CAPITAL * SMALL_PT];
    figure.text(&axis.label, at, Font::LABEL, Align::Centre, 0.0);
}

fn numbers_left(figure: &mut Figure, frame: Rect, axis: &Axis, ticks: &Ticks) {
    for (value, text) in &ticks.major {
        let at = frame.bottom() - axis.share(*value) * frame.height + 0.5 * CAPITAL * SMALL_PT;
        figure.text(text, [frame.left - GAP, at], Font::SMALL, Align::Right, 0.0);
    }
    // labels of panels above each other are aligned: the space for the numbers is the same everywhere
    let at = [frame.left - LEFT_LABEL, frame.centre()[1]];
    figure.text(&axis.label, at, Font::LABEL, Align::Centre, 90.0);
}

/// Distance of the baseline of a label from the left side of its panel (pt), with space for numbers of five characters.
const LEFT_LABEL: f64 = 27.0;

impl Shade {
    /// A vertical colour bar with ticks and a label, to the right of `beside`.
    pub fn upright_bar(&self, figure: &mut Figure, beside: Rect, label: &str) {
        let frame = Rect { left: beside.right() + 6.0, width: 6.0, ..beside };
        self.gradient(figure, frame, true);
        draw_right(figure, frame, &Axis::linear(label, [self.low, self.high]));
    }

    /// The same horizontally in `frame`, its ticks below; numbers rise to the right.
    pub fn lying_bar(&self, figure: &mut Figure, frame: Rect, label: &str) {
        self.gradient(figure, frame, false);
        draw_below(figure, frame, &Axis::linear(label, [self.low.min(self.high), self.low.max(self.high)]));
    }

    fn gradient(&self, figure: &mut Figure, frame: Rect, upright: bool) {
        const STEPS: usize = 100;
        let Rect { left, top, width, height } = frame;
        for k in 0..STEPS {
            let share = (k as f64 + 0.5) / STEPS as f64;
            let colour = self.map.at(if upright || self.high >= self.low { share } else { 1.0 - share });
            let (from, part) = (k as f64 / STEPS as f64, 1.0 / STEPS as f64);
            let cell = match upright {
                true => Rect { left, width, top: top + height * (1.0 - from - part), height: height * part },
                false => Rect { left: left + width * from, width: width * part, top, height },
            };
            figure.rect("scale", cell, Paint::cell(colour));
        }
        figure.rect("frame", frame, Paint::stroke(Stroke::new(BLACK, 0.6)));
    }
}

/// Ticks, numbers and label below a bar.
fn draw_below(figure: &mut Figure, frame: Rect, axis: &Axis) {
    let ticks = x_ticks(frame, axis, Room::Free);
    let mut path = Vec::new();
    for (value, _) in &ticks.major {
        let at = frame.left + axis.share(*value) * frame.width;
        path.extend([Segment::Move([at, frame.bottom()]), Segment::Line([at, frame.bottom() - 0.6 * MAJOR])]);
    }
    figure.path("ticks", path, Paint::stroke(PEN));
    numbers_below(figure, frame, axis, &ticks);
}

/// Ticks, numbers and label to the right of a bar.
fn draw_right(figure: &mut Figure, frame: Rect, axis: &Axis) {
    let ticks = y_ticks(frame, axis, Room::Free);
    let mut path = Vec::new();
    let mut widest: f64 = 0.0;
    for (value, text) in &ticks.major {
        let at = frame.bottom() - axis.share(*value) * frame.height;
        path.extend([Segment::Move([frame.right(), at]), Segment::Line([frame.right() - 0.6 * MAJOR, at])]);
        let baseline = at + 0.5 * CAPITAL * SMALL_PT;
        figure.text(text, [frame.right() + GAP, baseline], Font::SMALL, Align::Left, 0.0);
        widest = widest.max(width_pt(text, SMALL_PT));
    }
    figure.path("ticks", path, Paint::stroke(PEN));
    let at = [frame.right() + GAP + widest + GAP + LABEL_PT, frame.centre()[1]];
    figure.text(&axis.label, at, Font::LABEL, Align::Centre, 90.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_close_panels_stay_within_their_own_width() {
        let ranges = [[0.4, 1.9], [1.7198, 1.7202], [-0.05, 0.05], [2_459_310.2, 2_459_330.9], [0.0, 1.0]];
        for (range, width) in ranges.into_iter().flat_map(|range| [30.0, 60.0, 200.0].map(|width| (range, width))) {
            for scale in [Scale::Linear, Scale::Log] {
                if scale == Scale::Log && range[0] <= 0.0 {
                    continue;
                }
                let frame = Rect { left: 0.0, top: 0.0, width, height: width };
                let axis = Axis { label: String::new(), range, scale };
                let found = x_ticks(frame, &axis, Room::Own);
                let ends: Vec<[f64; 2]> = found
                    .major
                    .iter()
                    .map(|(value, text)| {
                        let (at, half) = (axis.share(*value) * width, 0.5 * width_pt(text, SMALL_PT));
                        [at - half, at + half]
                    })
                    .collect();
                assert!(ends.iter().all(|[from, to]| *from >= 0.0 && *to <= width), "{range:?} {width}: {found:?}");
                assert!(ends.windows(2).all(|pair| pair[0][1] + APART <= pair[1][0]), "{range:?} {width}: {found:?}");
                let heights = y_ticks(frame, &axis, Room::Own).major;
                let inside = |value: f64| (2.4..=width - 2.4).contains(&(axis.share(value) * width));
                assert!(heights.iter().all(|(value, _)| inside(*value)), "{range:?} {width}: {heights:?}");
            }
        }
    }
}
