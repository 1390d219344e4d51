//! Shapes of an SVG by their class, as far as tests look at them.
#![allow(dead_code)]

/// Points of every path of a class, one list a path.
pub fn paths(svg: &str, class: &str) -> Vec<Vec<[f64; 2]>> {
    let start = format!("<path class=\"{class}\" d=\"");
    svg.split(&start).skip(1).map(|rest| points(rest.split('"').next().unwrap())).collect()
}

/// Ends of all pieces of a path; control points left out.
fn points(path: &str) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    let mut rest = path;
    while let Some(command) = rest.chars().next() {
        let end = rest[1..].find(|c: char| c.is_ascii_alphabetic()).map_or(rest.len(), |k| k + 1);
        let numbers: Vec<f64> = rest[1..end].split_whitespace().map(|x| x.parse().unwrap()).collect();
        match (command, &numbers[..]) {
            ('H', [x]) => found.push([*x, found.last().unwrap()[1]]),
            ('V', [y]) => found.push([found.last().unwrap()[0], *y]),
            ('Z', []) => {}
            ('M' | 'L' | 'Q' | 'C', [.., x, y]) => found.push([*x, *y]),
            other => panic!("{other:?}"),
        }
        rest = &rest[end..];
    }
    found
}

/// From where to where points reach, along x and y.
pub fn extent(points: &[[f64; 2]]) -> [[f64; 2]; 2] {
    [0, 1].map(|k| {
        points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| [low.min(p[k]), high.max(p[k])])
    })
}

/// The middle of what points reach.
pub fn middle(points: &[[f64; 2]]) -> [f64; 2] {
    extent(points).map(|[low, high]| 0.5 * (low + high))
}

/// All texts.
pub fn texts(svg: &str) -> Vec<&str> {
    svg.split("aria-label=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}
