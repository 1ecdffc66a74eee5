//! Colours for light and for dark pages.

use std::str::FromStr;

use plotters::style::RGBColor;
use strum::IntoStaticStr;

/// The background of a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Theme {
    /// Paper.
    #[default]
    Light,
    /// A dark page or slide.
    Dark,
}

impl FromStr for Theme {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "light" => Ok(Theme::Light),
            "dark" => Ok(Theme::Dark),
            _ => Err("expected light or dark".to_owned()),
        }
    }
}

/// The colours of a theme.
pub(super) struct Palette {
    pub(super) background: RGBColor,
    pub(super) text: RGBColor,
    pub(super) axis: RGBColor,
    pub(super) grid: RGBColor,
    /// Bounds and references, sides of elements.
    pub(super) reference: RGBColor,
    /// Inside of a body without contours.
    pub(super) body: RGBColor,
    /// Curves and boundaries, distinguishable also with red–green colour blindness.
    pub(super) curves: [RGBColor; 6],
}

impl Theme {
    pub(super) fn palette(self) -> Palette {
        match self {
            Theme::Light => Palette {
                background: RGBColor(255, 255, 255),
                text: RGBColor(20, 20, 20),
                axis: RGBColor(90, 90, 90),
                grid: RGBColor(225, 225, 225),
                reference: RGBColor(120, 120, 120),
                body: RGBColor(244, 244, 240),
                curves: [
                    RGBColor(31, 78, 121),
                    RGBColor(192, 57, 43),
                    RGBColor(230, 159, 0),
                    RGBColor(0, 142, 115),
                    RGBColor(86, 160, 213),
                    RGBColor(150, 85, 150),
                ],
            },
            Theme::Dark => Palette {
                background: RGBColor(22, 25, 30),
                text: RGBColor(228, 230, 234),
                axis: RGBColor(160, 165, 172),
                grid: RGBColor(58, 63, 71),
                reference: RGBColor(150, 155, 162),
                body: RGBColor(40, 45, 52),
                curves: [
                    RGBColor(96, 165, 250),
                    RGBColor(248, 113, 99),
                    RGBColor(245, 185, 50),
                    RGBColor(45, 200, 160),
                    RGBColor(175, 215, 245),
                    RGBColor(215, 150, 215),
                ],
            },
        }
    }
}

/// Viridis at t from 0 to 1: even steps for the eye, also in grey and with red–green colour blindness.
pub(super) fn viridis(t: f64) -> RGBColor {
    const STOPS: [[f64; 3]; 9] = [
        [68.0, 1.0, 84.0],
        [71.0, 44.0, 122.0],
        [59.0, 81.0, 139.0],
        [44.0, 113.0, 142.0],
        [33.0, 144.0, 141.0],
        [39.0, 173.0, 129.0],
        [92.0, 200.0, 99.0],
        [170.0, 220.0, 50.0],
        [253.0, 231.0, 37.0],
    ];
    let place = t.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let k = (place as usize).min(STOPS.len() - 2);
    let part = place - k as f64;
    let mix = |c: usize| (STOPS[k][c] + part * (STOPS[k + 1][c] - STOPS[k][c])).round() as u8;
    RGBColor(mix(0), mix(1), mix(2))
}

/// As SVG writes it.
pub(super) fn hex(RGBColor(r, g, b): RGBColor) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}
