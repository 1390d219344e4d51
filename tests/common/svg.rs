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

/// A text that lies: what it says, from where to where along x, about, and its baseline.
pub struct Placed<'a> {
    pub text: &'a str,
    pub x: [f64; 2],
    pub y: f64,
}

/// All texts that lie.
pub fn placed(svg: &str) -> Vec<Placed<'_>> {
    let one = |rest| {
        let group: &str = str::split(rest, "</g>").next().unwrap();
        let glyphs: Vec<&str> = group.split("transform=\"translate(").skip(1).collect();
        if glyphs.is_empty() || group.contains("rotate(") {
            return None;
        }
        let numbers = |glyph: &str| -> Vec<f64> {
            glyph.split(['(', ')', ' ', '"']).filter_map(|word| word.parse().ok()).collect()
        };
        let (first, last) = (numbers(glyphs[0]), numbers(glyphs[glyphs.len() - 1]));
        // a digit is 0.57 times as wide as the font's size, which is 2048 units
        let x = [first[0], last[0] + 0.57 * 2048.0 * last[2]];
        Some(Placed { text: rest.split('"').next().unwrap(), x, y: first[1] })
    };
    svg.split("aria-label=\"").skip(1).filter_map(one).collect()
}
