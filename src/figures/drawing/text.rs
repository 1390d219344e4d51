//! Text as outlines of glyphs, so that a figure looks the same everywhere: Open Sans, which is included in the program
//! (Apache 2.0; reduced to Latin, Greek and some mathematics).
//!
//! Markup: `*italic*`, `_{subscript}`, `^{superscript}`.

use super::colour::{BLACK, Colour};
use super::{LABEL_PT, Point, SMALL_PT, Segment};
use std::sync::LazyLock;
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// Size and colour of a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Font {
    /// Size (pt).
    pub size: f64,
    /// Colour.
    pub colour: Colour,
}

impl Font {
    /// The font of axis labels.
    pub const LABEL: Font = Font { size: LABEL_PT, colour: BLACK };
    /// The font of the numbers at ticks, and of legends.
    pub const SMALL: Font = Font { size: SMALL_PT, colour: BLACK };

    /// The same in another colour.
    pub const fn coloured(self, colour: Colour) -> Self {
        Font { colour, ..self }
    }
}

/// Position of a text relative to its reference point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// It begins there.
    Left,
    /// It is centred on it.
    Centre,
    /// It ends there.
    Right,
}

/// Size of sub- and superscripts.
const SCRIPT: f64 = 0.7;

/// A glyph on the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Glyph {
    /// The shape.
    pub shape: Shape,
    /// Position of its origin.
    pub at: Point,
    /// Points per font unit.
    pub scale: f64,
    /// Its rotation (degrees, anticlockwise).
    pub turn: f64,
}

/// A glyph of one of the fonts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Shape {
    pub italic: bool,
    pub id: u16,
}

fn face(italic: bool) -> &'static Face<'static> {
    static FACES: [LazyLock<Face<'static>>; 2] = [LazyLock::new(|| read(REGULAR)), LazyLock::new(|| read(ITALIC))];
    const REGULAR: &[u8] = include_bytes!("font/OpenSans-Regular.ttf");
    const ITALIC: &[u8] = include_bytes!("font/OpenSans-Italic.ttf");
    fn read(font: &'static [u8]) -> Face<'static> {
        Face::parse(font, 0).expect("a font that comes with the program can be read")
    }
    &FACES[usize::from(italic)]
}

/// A character with its style from the markup.
struct Styled {
    character: char,
    italic: bool,
    /// Size over that of the text.
    size: f64,
    /// Height of its baseline above that of the text, in sizes of the text.
    rise: f64,
}

fn styled(text: &str) -> Vec<Styled> {
    let mut found = Vec::new();
    let (mut italic, mut size, mut rise) = (false, 1.0, 0.0);
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '*' => italic = !italic,
            '_' | '^' if characters.next_if_eq(&'{').is_some() => {
                (size, rise) = (SCRIPT, if character == '_' { -0.18 } else { 0.35 });
            }
            '}' if size < 1.0 => (size, rise) = (1.0, 0.0),
            // a number has a true minus, a word its hyphen
            '-' if characters.peek().is_some_and(char::is_ascii_digit)
                && !found.last().is_some_and(|last: &Styled| last.size == size && last.character.is_alphanumeric()) =>
            {
                found.push(Styled { character: '\u{2212}', italic, size, rise });
            }
            character => found.push(Styled { character, italic, size, rise }),
        }
    }
    found
}

/// The text without its markup.
pub fn plain(text: &str) -> String {
    styled(text).into_iter().map(|styled| styled.character).collect()
}

/// Width of a text (pt) at a size.
pub fn width_pt(text: &str, size: f64) -> f64 {
    styled(text).iter().map(|one| advance(one, size)).sum()
}

fn glyph_id(one: &Styled) -> GlyphId {
    let face = face(one.italic);
    face.glyph_index(one.character).or_else(|| face.glyph_index('?')).unwrap_or(GlyphId(0))
}

fn scale(one: &Styled, size: f64) -> f64 {
    one.size * size / f64::from(face(one.italic).units_per_em())
}

fn advance(one: &Styled, size: f64) -> f64 {
    f64::from(face(one.italic).glyph_hor_advance(glyph_id(one)).unwrap_or(0)) * scale(one, size)
}

/// The glyphs of a text whose baseline goes through `at`.
pub(super) fn lay_out(text: &str, at: Point, size: f64, align: Align, turn: f64) -> Vec<Glyph> {
    let characters = styled(text);
    let width: f64 = characters.iter().map(|one| advance(one, size)).sum();
    let mut along = match align {
        Align::Left => 0.0,
        Align::Centre => -0.5 * width,
        Align::Right => -width,
    };
    let (sin, cos) = turn.to_radians().sin_cos();
    let mut glyphs = Vec::new();
    for one in &characters {
        let up = one.rise * size;
        let place = [at[0] + along * cos - up * sin, at[1] - along * sin - up * cos];
        let shape = Shape { italic: one.italic, id: glyph_id(one).0 };
        if !one.character.is_whitespace() {
            glyphs.push(Glyph { shape, at: place, scale: scale(one, size), turn });
        }
        along += advance(one, size);
    }
    glyphs
}

/// The outline of a glyph in font units, upwards.
pub(super) fn outline(shape: Shape) -> Vec<Segment> {
    let mut outline = Outline(Vec::new());
    face(shape.italic).outline_glyph(GlyphId(shape.id), &mut outline);
    outline.0
}

struct Outline(Vec<Segment>);

fn point(x: f32, y: f32) -> Point {
    [f64::from(x), f64::from(y)]
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.push(Segment::Move(point(x, y)));
    }
    fn line_to(&mut self, x: f32, y: f32) {
        self.0.push(Segment::Line(point(x, y)));
    }
    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.push(Segment::Quad(point(x1, y1), point(x, y)));
    }
    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.push(Segment::Cubic(point(x1, y1), point(x2, y2), point(x, y)));
    }
    fn close(&mut self) {
        self.0.push(Segment::Close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_is_read_and_left_out() {
        assert_eq!(plain("*P*_{orb}/*P*_{rot}"), "Porb/Prot");
        assert_eq!(plain("-2 to 3, semi-amplitude, a_b"), "\u{2212}2 to 3, semi-amplitude, a_b");
        assert_eq!(plain("10^{-3}"), "10\u{2212}3");
        assert!(width_pt("*P*_{orb}", 8.0) < width_pt("*P*orb", 8.0));
    }

    #[test]
    fn every_character_that_figures_use_has_a_glyph() {
        for character in "ABCxyz0189()[]/%°±·×²ΔΩχφσψλ−≤≥≈′–".chars() {
            for italic in [false, true] {
                assert!(face(italic).glyph_index(character).is_some(), "{character}, italic: {italic}");
            }
        }
    }

    #[test]
    fn a_turned_text_runs_upwards() {
        let glyphs = lay_out("ab", [10.0, 20.0], 8.0, Align::Left, 90.0);
        assert!((glyphs[1].at[0] - 10.0).abs() < 1e-9 && glyphs[1].at[1] < 20.0);
        let centred = lay_out("ab", [10.0, 20.0], 8.0, Align::Centre, 0.0);
        assert!((centred[0].at[0] - 10.0 + 0.5 * width_pt("ab", 8.0)).abs() < 1e-9);
    }
}
