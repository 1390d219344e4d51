//! A figure as SVG 1.1. Glyphs are defined once and referenced; every text has its content as a label with its
//! outlines.

use super::text::{self, Shape};
use super::{Colour, Figure, Item, PT_PER_MM, Paint, Point, Segment};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// The figure as text.
pub(super) fn write(figure: &Figure) -> String {
    let Figure { name, width, height, .. } = figure;
    let (w, h) = (number(*width), number(*height));
    let (w_mm, h_mm) = (number(width / PT_PER_MM), number(height / PT_PER_MM));
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" width=\"{w_mm}mm\" \
         height=\"{h_mm}mm\" viewBox=\"0 0 {w} {h}\" role=\"img\">\n"
    );
    let title = if figure.caption.is_empty() { name } else { &figure.caption };
    let _ = writeln!(svg, "<title>{}</title>", escape(&text::plain(title)));
    svg += "<defs>\n";
    for shape in shapes(figure) {
        let id = glyph_id(name, shape);
        let _ = writeln!(svg, "<path id=\"{id}\" d=\"{}\"/>", path(&text::outline(shape)));
    }
    for (k, clip) in figure.clips.iter().enumerate() {
        let _ = writeln!(svg, "<clipPath id=\"{name}-clip{k}\"><path d=\"{}\"/></clipPath>", path(clip));
    }
    let _ = writeln!(svg, "</defs>\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>");
    for item in &figure.items {
        write_item(&mut svg, name, item);
    }
    svg + "</svg>\n"
}

fn write_item(svg: &mut String, name: &str, item: &Item) {
    match item {
        Item::Path { class, segments, paint, clip } => {
            let _ = write!(svg, "<path class=\"{class}\" d=\"{}\"{}", path(segments), attributes(paint));
            if let Some(clip) = clip {
                let _ = write!(svg, " clip-path=\"url(#{name}-clip{clip})\"");
            }
            *svg += "/>\n";
        }
        Item::Text { text, glyphs, colour } => {
            let _ = write!(svg, "<g class=\"text\" aria-label=\"{}\"{}>", escape(text), fill(*colour));
            for glyph in glyphs {
                let (x, y) = (number(glyph.at[0]), number(glyph.at[1]));
                let scale = format!("{:.6}", glyph.scale);
                let id = glyph_id(name, glyph.shape);
                let turn = if glyph.turn == 0.0 { String::new() } else { format!(" rotate({})", number(-glyph.turn)) };
                let transform = format!("translate({x} {y}){turn} scale({scale} -{scale})");
                let _ = write!(svg, "<use xlink:href=\"#{id}\" transform=\"{transform}\"/>");
            }
            *svg += "</g>\n";
        }
    }
}

fn shapes(figure: &Figure) -> BTreeSet<Shape> {
    let glyphs = figure.items.iter().flat_map(|item| match item {
        Item::Text { glyphs, .. } => glyphs.as_slice(),
        Item::Path { .. } => &[],
    });
    glyphs.map(|glyph| glyph.shape).collect()
}

/// The same glyph has a different name in every figure, so that a page may contain several figures.
fn glyph_id(name: &str, shape: Shape) -> String {
    format!("{name}-{}{}", if shape.italic { 'i' } else { 'r' }, shape.id)
}

fn attributes(paint: &Paint) -> String {
    let mut text = match paint.fill {
        Some(colour) if paint.sharp => fill(colour),
        // an area within an area is a hole
        Some(colour) => fill(colour) + " fill-rule=\"evenodd\"",
        None => " fill=\"none\"".to_owned(),
    };
    if let Some(stroke) = paint.stroke {
        let (rgb, opacity) = css(stroke.colour);
        let _ = write!(text, " stroke=\"{rgb}\" stroke-width=\"{}\" stroke-linejoin=\"round\"", number(stroke.width));
        if let Some(opacity) = opacity {
            let _ = write!(text, " stroke-opacity=\"{opacity}\"");
        }
        if !stroke.dash.is_empty() {
            let dash: Vec<String> = stroke.dash.iter().map(|x| number(*x)).collect();
            let _ = write!(text, " stroke-dasharray=\"{}\"", dash.join(" "));
        }
    }
    if paint.sharp {
        text += " shape-rendering=\"crispEdges\"";
    }
    text
}

fn fill(colour: Colour) -> String {
    let (rgb, opacity) = css(colour);
    let opacity = opacity.map_or_else(String::new, |opacity| format!(" fill-opacity=\"{opacity}\""));
    format!(" fill=\"{rgb}\"{opacity}")
}

/// A colour, and its opacity if it is not opaque.
fn css(Colour([r, g, b, a]): Colour) -> (String, Option<String>) {
    (format!("#{r:02x}{g:02x}{b:02x}"), (a < 255).then(|| number(f64::from(a) / 255.0)))
}

fn path(segments: &[Segment]) -> String {
    let mut text = String::new();
    // the position of the pen, as written
    let mut pen = [String::new(), String::new()];
    for segment in segments {
        let (letter, points): (char, &[Point]) = match segment {
            Segment::Move(a) => ('M', &[*a]),
            Segment::Line(a) => ('L', &[*a]),
            Segment::Quad(a, b) => ('Q', &[*a, *b]),
            Segment::Cubic(a, b, c) => ('C', &[*a, *b, *c]),
            Segment::Close => ('Z', &[]),
        };
        let written: Vec<[String; 2]> = points.iter().map(|p| p.map(number)).collect();
        match (letter, written.last()) {
            // lines along the axes have short forms
            ('L', Some([x, y])) if *y == pen[1] => text += &format!("H{x}"),
            ('L', Some([x, y])) if *x == pen[0] => text += &format!("V{y}"),
            _ => {
                text.push(letter);
                let pairs: Vec<String> = written.iter().map(|[x, y]| format!("{x} {y}")).collect();
                text += &pairs.join(" ");
            }
        }
        if let Some(last) = written.last() {
            pen.clone_from(last);
        }
    }
    text
}

/// A number to a hundredth, without trailing zeros.
fn number(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Escapes text for an attribute or an element, and control characters, which XML does not allow.
fn escape(text: &str) -> String {
    let shown = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    let text: String = text.chars().map(shown).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
