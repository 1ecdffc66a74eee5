//! A figure in pixels, as PNG.

use roxmltree::Document;
use tiny_skia::{
    FillRule, LineCap, LineJoin, Mask, Paint as Colour, Path, Pixmap, Rect, StrokeDash, Transform,
};

use super::MILLIMETRES_PER_INCH;
use super::letters::Fonts;
use super::svg::{self, Canvas, Line, Paint, Stroke};
use crate::plot::Size;

const DOTS_PER_INCH: f64 = 300.0;
const LEAST_DOTS_PER_INCH: f64 = 100.0;
/// Pixels at most: a figure of many panels has fewer to an inch, and with too few it could not be read. Each takes seven bytes
/// while it is drawn.
pub(super) const MOST_PIXELS: f64 = 8e6;

/// The figure as PNG of its size on paper.
pub(super) fn png(figure: &Document<'_>, fonts: &Fonts, size: Size) -> Result<Vec<u8>, String> {
    let [width, height] = svg::size(figure)?.map(f64::from);
    let wanted = size.millimetres() / MILLIMETRES_PER_INCH * DOTS_PER_INCH / width;
    let scale = wanted.min((MOST_PIXELS / (width * height)).sqrt());
    if scale < wanted * LEAST_DOTS_PER_INCH / DOTS_PER_INCH {
        return Err("it is too high for pixels that could be read: ask for .svg".to_owned());
    }
    let [columns, rows] = [width, height].map(|side| (side * scale).round().max(1.0) as u32);
    let mut canvas = Pixels {
        pixels: Pixmap::new(columns, rows).ok_or("there is no memory for its pixels")?,
        clip: None,
        scale: Transform::from_scale(
            (f64::from(columns) / width) as f32,
            (f64::from(rows) / height) as f32,
        ),
        fonts,
    };
    svg::draw(figure, fonts, &mut canvas)?;
    // the background is opaque, and so is every pixel
    let colours: Vec<u8> = canvas
        .pixels
        .data()
        .chunks_exact(4)
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect();
    drop(canvas);
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns, rows);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    // a program that reads it places it in its true size
    let per_metre = (scale * width / size.millimetres() * 1000.0).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    let written = encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&colours).and(writer.finish()));
    written.map_err(|error| error.to_string())?;
    Ok(bytes)
}

struct Pixels<'a> {
    pixels: Pixmap,
    /// Where it can be drawn on, pixel by pixel.
    clip: Option<Mask>,
    /// From the units of the drawing to pixels.
    scale: Transform,
    fonts: &'a Fonts,
}

fn colour(paint: Paint) -> Colour<'static> {
    let ([r, g, b], opacity) = (paint.rgb, (paint.opacity * 255.0).round() as u8);
    let mut colour = Colour::default();
    colour.set_color_rgba8(r, g, b, opacity);
    colour
}

impl Canvas for Pixels<'_> {
    fn fill(&mut self, path: &Path, rule: FillRule, paint: Paint) {
        let (paint, clip) = (colour(paint), self.clip.as_ref());
        self.pixels.fill_path(path, &paint, rule, self.scale, clip);
    }

    fn stroke(&mut self, path: &Path, stroke: &Stroke, paint: Paint) {
        let stroke = tiny_skia::Stroke {
            width: stroke.width,
            line_cap: match stroke.round_ends {
                true => LineCap::Round,
                false => LineCap::Butt,
            },
            line_join: match stroke.round_joins {
                true => LineJoin::Round,
                false => LineJoin::Miter,
            },
            dash: StrokeDash::new(stroke.dashes.clone(), 0.0),
            ..tiny_skia::Stroke::default()
        };
        let (paint, clip) = (colour(paint), self.clip.as_ref());
        self.pixels
            .stroke_path(path, &paint, &stroke, self.scale, clip);
    }

    fn letters(&mut self, line: &Line<'_>, paint: Paint) {
        let outlines = self
            .fonts
            .outlines(line.letters, line.size, line.start, line.along);
        if let Some(path) = outlines {
            self.fill(&path, FillRule::Winding, paint);
        }
    }

    fn clip(&mut self, to: Option<Rect>) {
        self.clip = to.and_then(|rect| {
            let mut mask = Mask::new(self.pixels.width(), self.pixels.height())?;
            let path = tiny_skia::PathBuilder::from_rect(rect);
            mask.fill_path(&path, FillRule::Winding, true, self.scale);
            Some(mask)
        });
    }
}
