//! Figures as PNG and PDF, made from their SVG: `svg` reads the SVG, `pixels` and `pdf` draw.
//!
//! Letters are those of DejaVu Sans, which the program contains: a figure is the same on every machine, with or without
//! fonts. Letters that this font lacks become empty boxes.

mod letters;
mod pdf;
mod pixels;
mod svg;

use letters::Fonts;
use roxmltree::Document;

use super::style::Size;

/// The format of a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Image {
    /// SVG: vectors, for a browser.
    #[default]
    Svg,
    /// PNG: pixels, 300 per inch.
    Png,
    /// PDF: vectors, for LaTeX; the text can be searched.
    Pdf,
}

/// The largest SVG that is converted (bytes); to draw an SVG takes several times this memory.
const LARGEST: usize = 4 << 20;

/// Writes a figure that was drawn as SVG as a file of the format `image`.
///
/// # Errors
///
/// The reason in words, if the SVG cannot be read or drawn.
pub fn write(svg: String, size: Size, image: Image) -> Result<Vec<u8>, String> {
    let draw = match image {
        Image::Svg => return Ok(svg.into_bytes()),
        Image::Png => pixels::png,
        Image::Pdf => pdf::pdf,
    };
    if svg.len() > LARGEST {
        return Err(format!(
            "the figure is too large to be converted ({} MB of SVG, at most {}): request .svg",
            svg.len().div_ceil(1 << 20),
            LARGEST >> 20
        ));
    }
    let figure = Document::parse(&svg).map_err(|error| error.to_string())?;
    draw(&figure, &Fonts::new()?, size)
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
        let height = |pixels: u32| svg.replacen("7200 1560", &format!("7200 {pixels}0"), 1);
        let tall = height(10_000);
        assert_ne!(svg, tall);
        let bytes = write(tall, Size::Page, Image::Png).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes))
            .read_info()
            .unwrap();
        let pixels = f64::from(reader.info().width) * f64::from(reader.info().height);
        assert!(pixels < 1.01 * pixels::MOST_PIXELS, "{pixels}");
        for image in [Image::Png, Image::Pdf] {
            let refused = write(height(200_000), Size::Page, image).unwrap_err();
            assert!(refused.contains("request .svg"), "{refused}");
        }
    }

    #[test]
    fn a_figure_that_is_too_large_is_refused_and_available_as_svg() {
        let mut svg = drawn(Size::Page);
        svg.push_str(&" ".repeat(LARGEST));
        assert!(
            write(svg.clone(), Size::Page, Image::Pdf)
                .unwrap_err()
                .contains("request .svg")
        );
        assert!(write(svg, Size::Page, Image::Svg).is_ok());
    }
}
