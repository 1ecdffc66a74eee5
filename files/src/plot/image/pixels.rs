//! Draws a figure in pixels, as PNG.

use roxmltree::Document;
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint as Colour, Path, Pixmap, Rect, StrokeDash, Transform,
};

use super::letters::Fonts;
use super::svg::{self, Canvas, Line, Paint, Stroke};
use crate::plot::Size;

const DOTS_PER_INCH: f64 = 300.0;
const LEAST_DOTS_PER_INCH: f64 = 100.0;
/// The largest number of pixels; a figure of many panels has fewer pixels per inch. While a figure is drawn, each pixel
/// takes eight bytes.
pub(super) const MOST_PIXELS: f64 = 8e6;

/// Writes a figure as PNG with the figure's size on paper.
pub(super) fn png(figure: &Document<'_>, fonts: &Fonts, size: Size) -> Result<Vec<u8>, String> {
    let [width, height] = svg::size(figure)?.map(f64::from);
    let wanted = size.inches() * DOTS_PER_INCH / width;
    let scale = wanted.min((MOST_PIXELS / (width * height)).sqrt());
    if scale < wanted * LEAST_DOTS_PER_INCH / DOTS_PER_INCH {
        return Err("the figure is too high to be readable as pixels: request .svg".to_owned());
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
    /// The picture before clipping, and the rectangle that is clipped to (units of the drawing).
    clip: Option<(Pixmap, [f32; 4])>,
    /// The transformation from the units of the drawing to pixels.
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
    fn shape(
        &mut self,
        path: &Path,
        inside: Option<(FillRule, Paint)>,
        line: Option<(Stroke, Paint)>,
    ) {
        if let Some((rule, paint)) = inside {
            self.pixels
                .fill_path(path, &colour(paint), rule, self.scale, None);
        }
        let Some((stroke, paint)) = line else {
            return;
        };
        let stroke = tiny_skia::Stroke {
            width: stroke.width,
            line_cap: if stroke.round_ends {
                LineCap::Round
            } else {
                LineCap::Butt
            },
            line_join: if stroke.round_joins {
                LineJoin::Round
            } else {
                LineJoin::Miter
            },
            dash: StrokeDash::new(stroke.dashes, 0.0),
            ..tiny_skia::Stroke::default()
        };
        self.pixels
            .stroke_path(path, &colour(paint), &stroke, self.scale, None);
    }

    fn letters(&mut self, line: &Line<'_>, paint: Paint) {
        let outlines = self
            .fonts
            .outlines(line.letters, line.size, line.start, line.along);
        if let Some(path) = outlines {
            self.shape(&path, Some((FillRule::Winding, paint)), None);
        }
    }

    fn clip(&mut self, to: Option<Rect>) {
        if let Some((before, inside)) = self.clip.take() {
            self.restore(&before, inside);
        }
        self.clip = to.map(|rect| {
            let inside = [rect.left(), rect.top(), rect.right(), rect.bottom()];
            (self.pixels.clone(), inside)
        });
    }
}

impl Pixels<'_> {
    /// Restores the pixels outside a rectangle (left, top, right, bottom) to the picture before: clipping by a mask
    /// while drawing would shift the colours where shapes touch.
    fn restore(&mut self, before: &Pixmap, inside: [f32; 4]) {
        let width = self.pixels.width() as usize;
        let scales = [self.scale.sx, self.scale.sy, self.scale.sx, self.scale.sy];
        let [left, top, right, bottom] =
            [0, 1, 2, 3].map(|side| (inside[side] * scales[side]).round().max(0.0) as usize);
        let right = right.min(width);
        let left = left.min(right);
        let rows = self.pixels.data_mut().chunks_exact_mut(4 * width);
        let rows = rows.zip(before.data().chunks_exact(4 * width));
        for (row, (now, before)) in rows.enumerate() {
            if (top..bottom).contains(&row) {
                now[..4 * left].copy_from_slice(&before[..4 * left]);
                now[4 * right..].copy_from_slice(&before[4 * right..]);
            } else {
                now.copy_from_slice(before);
            }
        }
    }
}
