//! Lines of equal value of a function on a rectangular grid, by marching squares: linear along the sides of a square,
//! with saddles resolved by the value in the middle.

use std::collections::HashMap;

/// A line; closed if it ends where it begins.
pub type Line = Vec<[f64; 2]>;

/// A side of a square of the grid: of node (i, j), to the right if `right`, else upwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Side {
    i: usize,
    j: usize,
    right: bool,
}

/// The lines where `value(i, j)`, at node i of `x` and j of `y` (both rising), is `level`. Squares with a value that is
/// not finite are omitted.
pub fn contour(x: &[f64], y: &[f64], value: impl Fn(usize, usize) -> f64, level: f64) -> Vec<Line> {
    let mut pieces = Vec::new();
    for j in 0..y.len().saturating_sub(1) {
        for i in 0..x.len().saturating_sub(1) {
            square(&value, level, i, j, &mut pieces);
        }
    }
    let place = |side: Side| {
        let Side { i, j, right } = side;
        let (k, l) = if right { (i + 1, j) } else { (i, j + 1) };
        let (a, b) = (value(i, j), value(k, l));
        let t = if b == a { 0.5 } else { ((level - a) / (b - a)).clamp(0.0, 1.0) };
        [x[i] + t * (x[k] - x[i]), y[j] + t * (y[l] - y[j])]
    };
    chains(&pieces).into_iter().map(|chain| chain.into_iter().map(place).collect()).collect()
}

/// The pieces of line in one square, each from side to side.
fn square(value: &impl Fn(usize, usize) -> f64, level: f64, i: usize, j: usize, pieces: &mut Vec<[Side; 2]>) {
    let corners = [value(i, j), value(i + 1, j), value(i + 1, j + 1), value(i, j + 1)];
    if corners.iter().any(|v| !v.is_finite()) {
        return;
    }
    let sides = [
        Side { i, j, right: true },
        Side { i: i + 1, j, right: false },
        Side { i, j: j + 1, right: true },
        Side { i, j, right: false },
    ];
    let above = corners.map(|v| v >= level);
    let crossed: Vec<usize> = (0..4).filter(|&k| above[k] != above[(k + 1) % 4]).collect();
    match crossed[..] {
        [a, b] => pieces.push([sides[a], sides[b]]),
        [_, _, _, _] => {
            // a saddle: the middle is joined to the corners on its side of the level, the other two are cut off
            let middle = 0.25 * corners.iter().sum::<f64>() >= level;
            let pairs = if middle == above[0] { [[0, 1], [2, 3]] } else { [[3, 0], [1, 2]] };
            pieces.extend(pairs.map(|[a, b]| [sides[a], sides[b]]));
        }
        _ => {}
    }
}

/// Pieces joined at their ends, in the order of the pieces.
fn chains(pieces: &[[Side; 2]]) -> Vec<Vec<Side>> {
    let mut at: HashMap<Side, Vec<usize>> = HashMap::new();
    for (k, piece) in pieces.iter().enumerate() {
        for side in piece {
            at.entry(*side).or_default().push(k);
        }
    }
    let mut used = vec![false; pieces.len()];
    let mut chains = Vec::new();
    for k in 0..pieces.len() {
        if used[k] {
            continue;
        }
        used[k] = true;
        let [first, last] = pieces[k];
        let mut chain = vec![first, last];
        extend(&mut chain, pieces, &at, &mut used);
        if chain[0] != chain[chain.len() - 1] {
            chain.reverse();
            extend(&mut chain, pieces, &at, &mut used);
        }
        chains.push(chain);
    }
    chains
}

/// Extends a chain at its end while there is a piece.
fn extend(chain: &mut Vec<Side>, pieces: &[[Side; 2]], at: &HashMap<Side, Vec<usize>>, used: &mut [bool]) {
    while let Some(&k) = at[&chain[chain.len() - 1]].iter().find(|&&k| !used[k]) {
        used[k] = true;
        let end = chain[chain.len() - 1];
        let [a, b] = pieces[k];
        chain.push(if a == end { b } else { a });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(count: usize) -> Vec<f64> {
        (0..count).map(|k| -1.0 + 2.0 * k as f64 / (count - 1) as f64).collect()
    }

    #[test]
    fn a_circle_is_one_closed_line() {
        let x = nodes(41);
        let lines = contour(&x, &x, |i, j| x[i] * x[i] + x[j] * x[j], 0.49);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].first(), lines[0].last());
        for [x, y] in &lines[0] {
            // linear interpolation of r^2 over a step of 0.05
            assert!((x.hypot(*y) - 0.7).abs() < 1e-3);
        }
    }

    #[test]
    fn lines_end_at_the_border_and_two_hills_are_two_lines() {
        let x = nodes(21);
        let straight = contour(&x, &x, |i, j| x[i] + 0.0 * x[j], 0.33);
        assert_eq!(straight.len(), 1);
        assert!(straight[0].iter().all(|p| (p[0] - 0.33).abs() < 1e-12));
        assert_eq!(straight[0].len(), 21);
        let hill = |x: f64, y: f64| (-40.0 * (x * x + y * y)).exp();
        let two = contour(&x, &x, |i, j| hill(x[i] - 0.5, x[j]) + hill(x[i] + 0.5, x[j]), 0.5);
        assert_eq!(two.len(), 2);
    }

    #[test]
    fn holes_are_left_out() {
        let x = nodes(5);
        let lines = contour(&x, &x, |i, j| if (i, j) == (2, 2) { f64::NAN } else { x[i] }, 0.1);
        assert_eq!(lines.len(), 2);
    }
}
