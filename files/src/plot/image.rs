//! Figures as PNG and PDF, made of their SVG.
//!
//! Letters are those of DejaVu Sans, which the program contains: a figure is the same on every machine, with or without
//! fonts. Letters that it lacks become empty boxes.

use std::sync::{Arc, LazyLock};

use krilla::geom::Size as PageSize;
use krilla::page::PageSettings;
use krilla_svg::{SurfaceExt, SvgSettings};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Options, Tree};

use super::style::Size;

/// What a figure is written as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Image {
    /// Vectors, for a browser.
    #[default]
    Svg,
    /// Pixels, 300 to an inch.
    Png,
    /// Vectors, for LaTeX; the letters can be searched.
    Pdf,
}

const DOTS_PER_INCH: f64 = 300.0;
const MILLIMETRES_PER_INCH: f64 = 25.4;
const POINTS_PER_INCH: f64 = 72.0;
/// Pixels at most: a figure of many panels has fewer to an inch, and with too few it could not be read. Each takes seven bytes
/// while it is drawn.
const MOST_PIXELS: f64 = 8e6;
const LEAST_DOTS_PER_INCH: f64 = 100.0;
/// Highest page that readers of PDF show (points).
const HIGHEST: f32 = 14_400.0;
/// Largest SVG that is converted (bytes): what is made of it while it is drawn takes some ten times as much.
const LARGEST: usize = 4 << 20;

/// Writes a drawn figure as a file of the given kind.
///
/// # Errors
///
/// The reason in words, if the SVG cannot be read or drawn.
pub fn write(svg: String, size: Size, image: Image) -> Result<Vec<u8>, String> {
    match image {
        Image::Svg => Ok(svg.into_bytes()),
        Image::Png => png(&tree(&svg)?, size),
        Image::Pdf => pdf(&tree(&svg)?, size),
    }
}

fn tree(svg: &str) -> Result<Tree, String> {
    if svg.len() > LARGEST {
        return Err(format!(
            "it is too large to be converted ({} MB of SVG, at most {}): ask for .svg",
            svg.len().div_ceil(1 << 20),
            LARGEST >> 20
        ));
    }
    static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
        let mut fonts = Database::new();
        for font in [dejavu::sans::regular(), dejavu::sans::bold()] {
            fonts.load_font_source(Source::Binary(Arc::new(font)));
        }
        fonts.set_sans_serif_family("DejaVu Sans");
        Arc::new(fonts)
    });
    let options = Options {
        fontdb: FONTS.clone(),
        font_family: "DejaVu Sans".to_owned(),
        ..Options::default()
    };
    Tree::from_str(svg, &options).map_err(|error| error.to_string())
}

fn png(tree: &Tree, size: Size) -> Result<Vec<u8>, String> {
    let (width, height) = (
        f64::from(tree.size().width()),
        f64::from(tree.size().height()),
    );
    let wanted = size.millimetres() / MILLIMETRES_PER_INCH * DOTS_PER_INCH / width;
    let scale = wanted.min((MOST_PIXELS / (width * height)).sqrt());
    if scale < wanted * LEAST_DOTS_PER_INCH / DOTS_PER_INCH {
        return Err("it is too high for pixels that could be read: ask for .svg".to_owned());
    }
    let [columns, rows] = [width, height].map(|side| (side * scale).round().max(1.0) as u32);
    let mut pixels = Pixmap::new(columns, rows).ok_or("there is no memory for its pixels")?;
    let transform = Transform::from_scale(
        (f64::from(columns) / width) as f32,
        (f64::from(rows) / height) as f32,
    );
    resvg::render(tree, transform, &mut pixels.as_mut());
    // the background is opaque, and so is every pixel
    let colours: Vec<u8> = pixels
        .data()
        .chunks_exact(4)
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect();
    drop(pixels);
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

fn pdf(tree: &Tree, size: Size) -> Result<Vec<u8>, String> {
    let width = (size.millimetres() / MILLIMETRES_PER_INCH * POINTS_PER_INCH) as f32;
    let height = width * tree.size().height() / tree.size().width();
    if height > HIGHEST {
        return Err("it is higher than a page of PDF may be: ask for .svg".to_owned());
    }
    let paper = PageSize::from_wh(width, height).ok_or("it has no size")?;
    let mut document = krilla::Document::new();
    let mut page = document.start_page_with(PageSettings::new(paper));
    let mut surface = page.surface();
    let drawn = surface.draw_svg(tree, paper, SvgSettings::default());
    surface.finish();
    page.finish();
    drawn.ok_or("it cannot be drawn on a page")?;
    document.finish().map_err(|error| format!("{error:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::{Caption, Style, Theme};

    fn drawn(size: Size) -> String {
        let caption = Caption {
            title: "Spannung σ_n, μ = 0.3".into(),
            parameters: vec!["ρ = 0.01 mm".into()],
            ..Caption::default()
        };
        let style = Style {
            size,
            theme: Theme::Dark,
            ..Style::default()
        };
        crate::plot::page::page(style, &caption, 100, |_| Ok(String::new())).unwrap()
    }

    #[test]
    fn pixels_are_as_many_as_an_inch_of_paper_has() {
        for (size, columns, per_metre) in [
            (Size::Column, 1039, 11_807),
            (Size::Page, 1890, 11_813),
            (Size::Slide, 3000, 11_811),
        ] {
            let bytes = write(drawn(size), size, Image::Png).unwrap();
            let reader = png::Decoder::new(std::io::Cursor::new(&bytes))
                .read_info()
                .unwrap();
            let info = reader.info();
            assert_eq!(info.width, columns);
            let dims = info.pixel_dims.unwrap();
            assert!(
                dims.xppu.abs_diff(per_metre) <= 6,
                "{size:?}: {}",
                dims.xppu
            );
        }
    }

    #[test]
    fn a_page_of_pdf_has_its_letters_and_is_the_same_every_time() {
        let pdf = || write(drawn(Size::Column), Size::Column, Image::Pdf).unwrap();
        let bytes = pdf();
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.starts_with("%PDF-") && text.contains("DejaVuSans"));
        assert_eq!(bytes, pdf());
    }

    #[test]
    fn a_figure_of_many_panels_has_fewer_pixels_to_an_inch() {
        let svg = drawn(Size::Page);
        let height =
            |pixels: u32| svg.replacen(r#"height="156""#, &format!(r#"height="{pixels}""#), 1);
        let tall = height(10_000);
        assert_ne!(svg, tall);
        let bytes = write(tall, Size::Page, Image::Png).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes))
            .read_info()
            .unwrap();
        let pixels = f64::from(reader.info().width) * f64::from(reader.info().height);
        assert!(pixels < 1.01 * MOST_PIXELS, "{pixels}");
        for image in [Image::Png, Image::Pdf] {
            let refused = write(height(200_000), Size::Page, image).unwrap_err();
            assert!(refused.contains("ask for .svg"), "{refused}");
        }
    }

    #[test]
    fn what_is_too_large_is_refused_and_stays_svg() {
        let mut svg = drawn(Size::Page);
        svg.push_str(&" ".repeat(LARGEST));
        assert!(
            write(svg.clone(), Size::Page, Image::Pdf)
                .unwrap_err()
                .contains("ask for .svg")
        );
        assert!(write(svg, Size::Page, Image::Svg).is_ok());
    }
}
