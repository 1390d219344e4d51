//! A smooth curve through points: cubic segments whose slopes are chosen so that it is monotonic between points, with
//! its extrema at points (Fritsch & Butland 1984).

use super::{Point, Segment};

/// Points closer than this (pt) are joined by straight lines: the difference is invisible.
const CLOSE: f64 = 0.5;

/// The path through `points`, whose x is monotonic.
pub(super) fn curve(points: &[Point]) -> Vec<Segment> {
    let Some(first) = points.first() else { return Vec::new() };
    let slopes = slopes(points);
    let mut path = vec![Segment::Move(*first)];
    for (k, pair) in points.windows(2).enumerate() {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        let third = (x1 - x0) / 3.0;
        path.push(match (x1 - x0).abs() < CLOSE && (y1 - y0).abs() < CLOSE {
            true => Segment::Line(pair[1]),
            false => {
                let [from, to] = [[x0 + third, y0 + third * slopes[k]], [x1 - third, y1 - third * slopes[k + 1]]];
                Segment::Cubic(from, to, pair[1])
            }
        });
    }
    path
}

/// Slopes at the points: zero at an extremum, elsewhere a weighted harmonic mean of those to either side.
fn slopes(points: &[Point]) -> Vec<f64> {
    let width: Vec<f64> = points.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let secant: Vec<f64> =
        points.windows(2).map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).collect();
    let n = points.len();
    let at = |k: usize| match (k.checked_sub(1).map(|before| secant[before]), secant.get(k)) {
        (Some(before), Some(&after)) if before * after > 0.0 && before.is_finite() && after.is_finite() => {
            let (a, b) = (2.0 * width[k] + width[k - 1], width[k] + 2.0 * width[k - 1]);
            (a + b) / (a / before + b / after)
        }
        // an end continues straight
        (None, Some(&one)) | (Some(one), None) if one.is_finite() => one,
        _ => 0.0,
    };
    (0..n).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_has_its_maxima_on_the_points_and_is_close_to_what_they_are_of() {
        let bell = |x: f64| 50.0 * (-0.5 * (x / 12.0) * (x / 12.0)).exp();
        let points: Vec<Point> = (-6..=6).map(|k| 8.0 * f64::from(k)).map(|x| [x, bell(x)]).collect();
        let path = curve(&points);
        let mut pen = points[0];
        let (mut highest, mut worst) = (0.0_f64, 0.0_f64);
        for segment in &path[1..] {
            let Segment::Cubic(a, b, end) = *segment else { panic!("{segment:?}") };
            for step in 0..=20 {
                let t = f64::from(step) / 20.0;
                let u = 1.0 - t;
                let mix = |k: usize| {
                    u * u * u * pen[k] + 3.0 * u * u * t * a[k] + 3.0 * u * t * t * b[k] + t * t * t * end[k]
                };
                highest = highest.max(mix(1));
                worst = worst.max((mix(1) - bell(mix(0))).abs());
            }
            pen = end;
        }
        assert!((highest - 50.0).abs() < 1e-9, "{highest}");
        // straight lines are off by 2.6
        assert!(worst < 1.0, "{worst}");
    }

    #[test]
    fn one_point_and_equal_points_are_no_trouble() {
        assert_eq!(curve(&[]), []);
        assert_eq!(curve(&[[1.0, 2.0]]), [Segment::Move([1.0, 2.0])]);
        let level = curve(&[[0.0, 1.0], [5.0, 1.0], [5.0, 1.0], [9.0, 3.0]]);
        let finite = |segment: &Segment| match segment {
            Segment::Cubic(a, b, c) => [a, b, c].iter().all(|p| p[0].is_finite() && p[1].is_finite()),
            _ => true,
        };
        assert!(level.iter().all(finite), "{level:?}");
    }
}
