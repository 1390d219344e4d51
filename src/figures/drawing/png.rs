//! A figure as PNG: opaque, on white, with the same shapes as the SVG.

use super::text;
use super::{Colour, Figure, Item, Paint, Point, Segment};
use tiny_skia::{FillRule, Mask, PathBuilder, Pixmap, Stroke, StrokeDash, Transform};

/// Points in an inch.
const PT_PER_INCH: f64 = 72.0;

/// The file.
pub(super) fn write(figure: &Figure, dpi: f64) -> Vec<u8> {
    let scale = dpi / PT_PER_INCH;
    let pixels = |points: f64| (points * scale).ceil().max(1.0) as u32;
    let (width, height) = (pixels(figure.width), pixels(figure.height));
    let mut page = Pixmap::new(width, height).expect("a page has an area");
    page.fill(tiny_skia::Color::WHITE);
    let to_page = Transform::from_scale(scale as f32, scale as f32);
    let masks: Vec<Mask> = figure.clips.iter().map(|clip| mask(width, height, clip, to_page)).collect();
    for item in &figure.items {
        match item {
            Item::Path { segments, paint, clip, .. } => {
                let rule = if paint.sharp { FillRule::Winding } else { FillRule::EvenOdd };
                draw(&mut page, segments, paint, rule, to_page, clip.map(|k| &masks[k]));
            }
            Item::Text { glyphs, colour, .. } => {
                for glyph in glyphs {
                    let unit = glyph.scale as f32;
                    let placed = to_page
                        .pre_translate(glyph.at[0] as f32, glyph.at[1] as f32)
                        .pre_concat(Transform::from_rotate(-glyph.turn as f32))
                        .pre_scale(unit, -unit);
                    draw(
                        &mut page,
                        &text::outline(glyph.shape),
                        &Paint::fill(*colour),
                        FillRule::Winding,
                        placed,
                        None,
                    );
                }
            }
        }
    }
    encode(&page, dpi)
}

fn mask(width: u32, height: u32, clip: &[Segment], to_page: Transform) -> Mask {
    let mut mask = Mask::new(width, height).expect("a page has an area");
    if let Some(path) = path(clip) {
        mask.fill_path(&path, FillRule::Winding, true, to_page);
    }
    mask
}

/// Draws a path; `rule` decides on holes of areas.
fn draw(
    page: &mut Pixmap,
    segments: &[Segment],
    paint: &Paint,
    rule: FillRule,
    to_page: Transform,
    mask: Option<&Mask>,
) {
    let Some(path) = path(segments) else { return };
    if let Some(colour) = paint.fill {
        page.fill_path(&path, &pen(colour, paint.sharp), rule, to_page, mask);
    }
    if let Some(stroke) = paint.stroke {
        let dash: Vec<f32> = stroke.dash.iter().map(|x| *x as f32).collect();
        let pen_stroke = Stroke {
            width: stroke.width as f32,
            line_join: tiny_skia::LineJoin::Round,
            dash: StrokeDash::new(dash, 0.0),
            ..Stroke::default()
        };
        page.stroke_path(&path, &pen(stroke.colour, paint.sharp), &pen_stroke, to_page, mask);
    }
}

fn pen(Colour([r, g, b, a]): Colour, sharp: bool) -> tiny_skia::Paint<'static> {
    let mut pen = tiny_skia::Paint { anti_alias: !sharp, ..tiny_skia::Paint::default() };
    pen.set_color_rgba8(r, g, b, a);
    pen
}

/// The path in the rasteriser's format; `None` for one without extent.
fn path(segments: &[Segment]) -> Option<tiny_skia::Path> {
    let mut builder = PathBuilder::new();
    let f = |[x, y]: Point| (x as f32, y as f32);
    for segment in segments {
        match *segment {
            Segment::Move(a) => builder.move_to(f(a).0, f(a).1),
            Segment::Line(a) => builder.line_to(f(a).0, f(a).1),
            Segment::Quad(a, b) => builder.quad_to(f(a).0, f(a).1, f(b).0, f(b).1),
            Segment::Cubic(a, b, c) => builder.cubic_to(f(a).0, f(a).1, f(b).0, f(b).1, f(c).0, f(c).1),
            Segment::Close => builder.close(),
        }
    }
    builder.finish()
}

/// The page as red, green and blue: it is opaque everywhere.
fn encode(page: &Pixmap, dpi: f64) -> Vec<u8> {
    let rgb: Vec<u8> = page.data().chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, page.width(), page.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let per_metre = (dpi / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter }));
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&rgb));
    written.expect("writing to memory does not fail");
    bytes
}
