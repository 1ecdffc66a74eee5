//! Writes a figure as a page of PDF: paths, and text that can be searched, with the needed part of the fonts embedded.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hasher};
use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{
    CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, UnicodeCmap,
};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect as Corners, Ref, Str};
use roxmltree::Document;
use subsetter::GlyphRemapper;
use tiny_skia::{FillRule, Path, PathSegment, Point, Rect};

use super::letters::{Font, Fonts};
use super::svg::{self, Canvas, Line, Paint, Stroke};
use crate::plot::Size;

const POINTS_PER_INCH: f64 = 72.0;
/// The largest height of a page that PDF readers show (points).
const HIGHEST: f32 = 14_400.0;
/// The height of a font in the units of a PDF font.
const PER_EM: f32 = 1000.0;
/// The names of the fonts on the page.
const FONTS: [Name<'static>; 2] = [Name(b"F0"), Name(b"F1")];
/// The numbering of glyphs in the PDF: by their numbers in the embedded part of the font.
const NUMBERING: SystemInfo<'static> = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
};

/// Writes a figure as a PDF page with the figure's size on paper.
pub(super) fn pdf(figure: &Document<'_>, fonts: &Fonts, size: Size) -> Result<Vec<u8>, String> {
    let [wide, high] = svg::size(figure)?;
    let width = (size.inches() * POINTS_PER_INCH) as f32;
    let scale = width / wide;
    let height = high * scale;
    if height > HIGHEST {
        return Err("the figure is higher than a page of PDF may be: request .svg".to_owned());
    }
    let mut page = Page {
        content: Content::new(),
        parts: Default::default(),
        opacities: BTreeSet::new(),
        clipped: false,
    };
    // in a PDF y is up
    page.content.save_state();
    page.content
        .transform([scale, 0.0, 0.0, -scale, 0.0, height]);
    svg::draw(figure, fonts, &mut page)?;
    page.content.restore_state();

    let mut next = 0;
    let mut number = || {
        next += 1;
        Ref::new(next)
    };
    let [catalogue, pages, only, content] = [(); 4].map(|()| number());
    let mut pdf = Pdf::new();
    pdf.catalog(catalogue).pages(pages);
    pdf.pages(pages).kids([only]).count(1);
    let parts = fonts.0.iter().zip(&page.parts).zip(FONTS);
    let used = parts.filter(|((_, part), _)| !part.letters.is_empty());
    let used: Vec<_> = used
        .map(|((font, part), name)| (font, part, name, [(); 5].map(|()| number())))
        .collect();

    let mut sheet = pdf.page(only);
    sheet.parent(pages).contents(content);
    sheet.media_box(Corners::new(0.0, 0.0, width, height));
    let mut group = sheet.group();
    group.transparency().color_space().device_rgb();
    group.finish();
    let mut resources = sheet.resources();
    let mut named = resources.fonts();
    for (_, _, name, [id, ..]) in &used {
        named.pair(*name, *id);
    }
    named.finish();
    let mut states = resources.ext_g_states();
    for state in &page.opacities {
        let opacity = f32::from(state.1) / 1000.0;
        let mut written = states
            .insert(Name(opacity_name(*state).as_bytes()))
            .start::<pdf_writer::writers::ExtGraphicsState<'_>>();
        match state.0 {
            'F' => written.non_stroking_alpha(opacity),
            _ => written.stroking_alpha(opacity),
        };
    }
    states.finish();
    resources.finish();
    sheet.finish();
    let drawn = compressed(page.content.finish().as_slice())?;
    pdf.stream(content, &drawn).filter(Filter::FlateDecode);
    for (font, part, _, numbers) in used {
        part.embed(font, numbers, &mut pdf)?;
    }
    Ok(pdf.finish())
}

/// The name of the PDF graphics state for an opacity (thousandths) of fills (`F`) or of lines (`S`).
fn opacity_name((what, thousandths): (char, u16)) -> String {
    format!("{what}{thousandths}")
}

fn compressed(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.map_err(|error| error.to_string())
}

/// The part of a font that the PDF embeds: the letters that the figure needs.
#[derive(Default)]
struct Part {
    glyphs: GlyphRemapper,
    /// By the number of a glyph in this part of the font: the first letter that the glyph stands for, and its width.
    letters: BTreeMap<u16, (char, f32)>,
}

impl Part {
    /// Writes the part of the font as PDF objects with these numbers.
    fn embed(&self, font: &Font, numbers: [Ref; 5], pdf: &mut Pdf) -> Result<(), String> {
        let [id, descendant, descriptor, file, unicode] = numbers;
        let bytes = subsetter::subset(font.bytes, 0, &self.glyphs);
        let bytes = bytes.map_err(|error| error.to_string())?;
        let name = format!("{}+{}", self.tag(), font.name);
        let name = Name(name.as_bytes());
        pdf.type0_font(id)
            .base_font(name)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(descendant)
            .to_unicode(unicode);
        let mut cid = pdf.cid_font(descendant);
        cid.subtype(CidFontType::Type2)
            .base_font(name)
            .system_info(NUMBERING)
            .font_descriptor(descriptor)
            .default_width(0.0)
            .cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = cid.widths();
        for (glyph, (_, width)) in &self.letters {
            widths.consecutive(*glyph, [width * PER_EM]);
        }
        widths.finish();
        cid.finish();
        let face = &font.face;
        let bounds = face.global_bounding_box();
        let [left, low, right, high] = [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max]
            .map(|units| font.em(units) * PER_EM);
        pdf.font_descriptor(descriptor)
            .name(name)
            .flags(FontFlags::SYMBOLIC)
            .bbox(Corners::new(left, low, right, high))
            .italic_angle(0.0)
            .ascent(font.em(face.ascender()) * PER_EM)
            .descent(font.em(face.descender()) * PER_EM)
            .cap_height(font.em(face.capital_height().unwrap_or(0)) * PER_EM)
            // no table of a font says it: that of Helvetica
            .stem_v(if face.is_bold() { 118.0 } else { 76.0 })
            .font_file2(file);
        let length = bytes.len() as i32;
        pdf.stream(file, &compressed(&bytes)?)
            .filter(Filter::FlateDecode)
            .pair(Name(b"Length1"), length);
        let mut map = UnicodeCmap::new(Name(b"Letters"), NUMBERING);
        for (glyph, (char, _)) in &self.letters {
            map.pair(*glyph, *char);
        }
        let map = map.finish();
        pdf.cmap(unicode, &compressed(map.as_slice())?)
            .filter(Filter::FlateDecode);
        Ok(())
    }

    /// Six letters that identify the part of the font. Different parts of one font have different letters, so that
    /// programs that join documents keep both parts.
    fn tag(&self) -> String {
        let mut hasher = DefaultHasher::new();
        for glyph in self.glyphs.remapped_gids() {
            hasher.write_u16(glyph);
        }
        let mut value = Hasher::finish(&hasher);
        let mut letter = || {
            let letter = (value % 26) as u8;
            value /= 26;
            char::from(b'A' + letter)
        };
        (0..6).map(|_| letter()).collect()
    }
}

struct Page {
    content: Content,
    parts: [Part; 2],
    /// The opacities in use (thousandths), each for fills (`F`) or for lines (`S`).
    opacities: BTreeSet<(char, u16)>,
    clipped: bool,
}

impl Page {
    /// Sets opacity and colour of fills (`F`) or of lines (`S`).
    fn paint(&mut self, what: char, paint: Paint) {
        let state = (what, (paint.opacity * 1000.0).round() as u16);
        self.opacities.insert(state);
        self.content
            .set_parameters(Name(opacity_name(state).as_bytes()));
        let [r, g, b] = paint.rgb.map(|part| f32::from(part) / 255.0);
        match what {
            'F' => self.content.set_fill_rgb(r, g, b),
            _ => self.content.set_stroke_rgb(r, g, b),
        };
    }

    fn path(&mut self, path: &Path) {
        let mut here = Point::zero();
        let part = |from: f32, to: f32| from + (to - from) * 2.0 / 3.0;
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(p) => {
                    self.content.move_to(p.x, p.y);
                    here = p;
                }
                PathSegment::LineTo(p) => {
                    self.content.line_to(p.x, p.y);
                    here = p;
                }
                // PDF has cubic curves alone
                PathSegment::QuadTo(c, p) => {
                    let (a, b) = (part(here.x, c.x), part(here.y, c.y));
                    let (c, d) = (part(p.x, c.x), part(p.y, c.y));
                    self.content.cubic_to(a, b, c, d, p.x, p.y);
                    here = p;
                }
                PathSegment::CubicTo(c, d, p) => {
                    self.content.cubic_to(c.x, c.y, d.x, d.y, p.x, p.y);
                    here = p;
                }
                PathSegment::Close => {
                    self.content.close_path();
                }
            }
        }
    }
}

impl Canvas for Page {
    fn shape(
        &mut self,
        path: &Path,
        inside: Option<(FillRule, Paint)>,
        line: Option<(Stroke, Paint)>,
    ) {
        if let Some((_, paint)) = inside {
            self.paint('F', paint);
        }
        let rule = inside.map(|(rule, _)| rule);
        let lined = line.is_some();
        if let Some((stroke, paint)) = line {
            self.paint('S', paint);
            self.content
                .set_line_width(stroke.width)
                .set_line_cap(if stroke.round_ends {
                    LineCapStyle::RoundCap
                } else {
                    LineCapStyle::ButtCap
                })
                .set_line_join(if stroke.round_joins {
                    LineJoinStyle::RoundJoin
                } else {
                    LineJoinStyle::MiterJoin
                })
                // as SVG has it
                .set_miter_limit(4.0)
                .set_dash_pattern(stroke.dashes, 0.0);
        }
        self.path(path);
        match (rule, lined) {
            (Some(FillRule::EvenOdd), true) => self.content.fill_even_odd_and_stroke(),
            (Some(FillRule::Winding), true) => self.content.fill_nonzero_and_stroke(),
            (Some(FillRule::EvenOdd), false) => self.content.fill_even_odd(),
            (Some(FillRule::Winding), false) => self.content.fill_nonzero(),
            (None, true) => self.content.stroke(),
            (None, false) => self.content.end_path(),
        };
    }

    fn letters(&mut self, line: &Line<'_>, paint: Paint) {
        self.paint('F', paint);
        let ([x, y], [cos, sin]) = (line.start, line.along);
        for letters in line.letters.chunk_by(|a, b| a.font == b.font) {
            let (font, from) = (letters[0].font, letters[0].place * line.size);
            self.content
                .begin_text()
                .set_font(FONTS[font], line.size)
                .set_text_matrix([cos, sin, sin, -cos, x + from * cos, y + from * sin]);
            let part = &mut self.parts[font];
            let mut shown = self.content.show_positioned();
            let mut items = shown.items();
            let mut end = letters[0].place;
            for letter in letters {
                let nearer = (end - letter.place) * PER_EM;
                if nearer.abs() > 0.5 {
                    items.adjust(nearer);
                }
                let glyph = part.glyphs.remap(letter.glyph.0);
                part.letters
                    .entry(glyph)
                    .or_insert((letter.char, letter.width));
                items.show(Str(&glyph.to_be_bytes()));
                end = letter.place + letter.width;
            }
            items.finish();
            shown.finish();
            self.content.end_text();
        }
    }

    fn clip(&mut self, to: Option<Rect>) {
        if std::mem::take(&mut self.clipped) {
            self.content.restore_state();
        }
        if let Some(rect) = to {
            self.clipped = true;
            self.content
                .save_state()
                .rect(rect.x(), rect.y(), rect.width(), rect.height())
                .clip_nonzero()
                .end_path();
        }
    }
}
