//! Places the letters of a text in a figure: those of DejaVu Sans, regular and bold, one after another from the left,
//! with kerning. There are no ligatures; scripts that run from the right or join their letters are not set correctly.

use tiny_skia::{Path, PathBuilder};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// A letter of a line of text. Lengths are in heights of the font (em).
#[derive(Clone, Copy, Debug)]
pub(super) struct Letter {
    pub(super) char: char,
    /// The number of the font in [`Fonts`].
    pub(super) font: usize,
    pub(super) glyph: GlyphId,
    /// The distance of the letter from the start of the line.
    pub(super) place: f32,
    pub(super) width: f32,
}

/// A font, with its name in a PDF.
pub(super) struct Font {
    pub(super) name: &'static str,
    pub(super) bytes: &'static [u8],
    pub(super) face: Face<'static>,
}

impl Font {
    fn new(name: &'static str, bytes: &'static [u8]) -> Result<Font, String> {
        let face = Face::parse(bytes, 0).map_err(|error| error.to_string())?;
        Ok(Font { name, bytes, face })
    }

    /// Converts a length from the units of the font to heights of the font (em).
    pub(super) fn em(&self, units: i16) -> f32 {
        f32::from(units) / f32::from(self.face.units_per_em())
    }

    /// The kerning of two letters: a change of the distance between them (em).
    fn kerning(&self, left: GlyphId, right: GlyphId) -> f32 {
        let tables = self.face.tables().kern.iter();
        let mut parts = tables
            .flat_map(|kern| kern.subtables)
            .filter(|part| part.horizontal && !part.variable);
        let found = parts.find_map(|part| part.glyphs_kerning(left, right));
        self.em(found.unwrap_or(0))
    }
}

/// The regular and the bold font.
pub(super) struct Fonts(pub(super) [Font; 2]);

impl Fonts {
    pub(super) fn new() -> Result<Fonts, String> {
        Ok(Fonts([
            Font::new("DejaVuSans", dejavu::sans::regular())?,
            Font::new("DejaVuSans-Bold", dejavu::sans::bold())?,
        ]))
    }

    /// The letters of a text with their places, and the width of the text (em).
    pub(super) fn line(&self, text: &str, bold: bool) -> (Vec<Letter>, f32) {
        let wanted = usize::from(bold);
        let mut letters: Vec<Letter> = Vec::new();
        let mut end = 0.0;
        for char in text.chars() {
            let known = |font: usize| Some((font, self.0[font].face.glyph_index(char)?));
            // what neither has is an empty box: the first glyph of every font
            let (font, glyph) = known(wanted)
                .or_else(|| known(1 - wanted))
                .unwrap_or((wanted, GlyphId(0)));
            if let Some(before) = letters.last().filter(|before| before.font == font) {
                end += self.0[font].kerning(before.glyph, glyph);
            }
            let width = self.0[font].face.glyph_hor_advance(glyph).unwrap_or(0);
            let width = f32::from(width) / f32::from(self.0[font].face.units_per_em());
            letters.push(Letter {
                char,
                font,
                glyph,
                place: end,
                width,
            });
            end += width;
        }
        (letters, end)
    }

    /// The outlines of letters of height `size`, on a line that begins at `start` in the direction `along`; y points
    /// down.
    pub(super) fn outlines(
        &self,
        letters: &[Letter],
        size: f32,
        start: [f32; 2],
        along: [f32; 2],
    ) -> Option<Path> {
        let mut pen = Pen {
            path: PathBuilder::new(),
            scale: 0.0,
            start: [0.0; 2],
            along,
        };
        for letter in letters {
            let face = &self.0[letter.font].face;
            pen.scale = size / f32::from(face.units_per_em());
            pen.start = [0, 1].map(|a| start[a] + letter.place * size * along[a]);
            // a blank has none
            let _ = face.outline_glyph(letter.glyph, &mut pen);
        }
        pen.path.finish()
    }
}

/// Moves outlines of letters to their place on the page.
struct Pen {
    path: PathBuilder,
    scale: f32,
    start: [f32; 2],
    along: [f32; 2],
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> [f32; 2] {
        let ([x, y], [cos, sin]) = ([x * self.scale, y * self.scale], self.along);
        [
            self.start[0] + x * cos + y * sin,
            self.start[1] + x * sin - y * cos,
        ]
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let [x, y] = self.at(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let [x, y] = self.at(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ([a, b], [x, y]) = (self.at(x1, y1), self.at(x, y));
        self.path.quad_to(a, b, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ([a, b], [c, d], [x, y]) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.path.cubic_to(a, b, c, d, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stand_one_after_another_and_unknown_ones_are_boxes() {
        let fonts = Fonts::new().unwrap();
        let (letters, width) = fonts.line("σ₁ 漢", false);
        assert_eq!(letters.len(), 4);
        assert!(letters.windows(2).all(|pair| pair[0].place < pair[1].place));
        assert_eq!(width, letters[3].place + letters[3].width);
        assert_ne!(letters[0].glyph.0, 0);
        assert_eq!(letters[3].glyph.0, 0);
        assert!(
            fonts
                .outlines(&letters[2..3], 10.0, [0.0; 2], [1.0, 0.0])
                .is_none()
        );
        let bold = fonts.line("Title", true);
        assert!(bold.1 > fonts.line("Title", false).1);
        let pair = |text| fonts.line(text, false).1;
        assert!(pair("AV") < pair("A") + pair("V"), "kerning");
    }

    #[test]
    fn a_letter_that_only_the_regular_font_has_is_not_bold() {
        let fonts = Fonts::new().unwrap();
        // a letter of formulas
        let (letters, _) = fonts.line("A\u{1d5a2}", true);
        assert_eq!([letters[0].font, letters[1].font], [1, 0]);
        assert_ne!(letters[1].glyph.0, 0);
    }

    #[test]
    fn a_line_runs_in_its_direction() {
        let fonts = Fonts::new().unwrap();
        let (letters, _) = fonts.line("lll", false);
        let bounds = |along| {
            fonts
                .outlines(&letters, 10.0, [5.0, 7.0], along)
                .unwrap()
                .bounds()
        };
        let (right, up) = (bounds([1.0, 0.0]), bounds([0.0, -1.0]));
        assert!(
            right.left() >= 5.0 && right.bottom() <= 7.0 && right.top() < 1.0,
            "{right:?}"
        );
        assert!(up.right() <= 5.0 && up.bottom() <= 7.0, "{up:?}");
        assert!((right.width() - up.height()).abs() < 1e-4);
    }
}
