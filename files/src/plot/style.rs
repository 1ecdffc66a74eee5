//! The style of a figure: its colours, its size, the texts around it, the limits of its axes, and the stress that it shows.

use std::str::FromStr;

use strum::{IntoStaticStr, VariantArray};

use super::limits::AxisLimits;
use super::theme::{Palette, Theme};

/// What a figure is for, which determines its size in relation to its letters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum Size {
    /// A column of a journal, 88 mm: letters of 7 pt.
    Column,
    /// A page, 160 mm: letters of 9 pt.
    #[default]
    Page,
    /// A slide of 16:9, 254 mm × 142.9 mm: letters of 12.5 pt. Panels are side by side; a figure with too many of them is
    /// higher.
    Slide,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = Size::VARIANTS.iter().find(|size| size.as_str() == text);
        named
            .copied()
            .ok_or_else(|| "expected column, page or slide".to_owned())
    }
}

impl Size {
    /// The name of the size in queries.
    pub fn as_str(self) -> &'static str {
        self.into()
    }

    /// The width of a figure on paper, in millimetres.
    pub(super) fn millimetres(self) -> f64 {
        match self {
            Size::Column => 88.0,
            Size::Page => 160.0,
            Size::Slide => 254.0,
        }
    }

    /// The width of a figure on paper, in inches.
    pub(super) fn inches(self) -> f64 {
        self.millimetres() / 25.4
    }
}

/// The texts around a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum Texts {
    /// Title and parameters, verdict and warnings.
    #[default]
    Full,
    /// None of these: a caption that somebody else writes says what the figure shows, and how reliable it is.
    Bare,
}

impl FromStr for Texts {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut known = Texts::VARIANTS.iter();
        let named = known.find(|texts| texts.as_str() == text);
        named
            .copied()
            .ok_or_else(|| "expected full or bare".to_owned())
    }
}

impl Texts {
    /// The name of the style in queries.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

/// The style of a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Style {
    /// The colours of the figure.
    pub theme: Theme,
    /// The use of the figure, which determines its size.
    pub size: Size,
    /// The texts around the figure.
    pub texts: Texts,
    /// The limits of the axes.
    pub limits: AxisLimits,
    /// The stress that the contours of `deformed` show.
    pub stress: Stress,
}

impl Style {
    pub(super) fn palette(self) -> Palette {
        self.theme.palette()
    }

    /// The width of a figure in pixels, where letters are 15 pixels high.
    pub(super) fn width(self) -> i32 {
        match self.size {
            Size::Column => 520,
            Size::Page => 720,
            Size::Slide => 864,
        }
    }

    /// The height of a figure in pixels, if it is given.
    pub(super) fn height(self) -> Option<i32> {
        match self.size {
            Size::Column | Size::Page => None,
            Size::Slide => Some(486),
        }
    }
}

impl From<Theme> for Style {
    fn from(theme: Theme) -> Self {
        Style {
            theme,
            ..Style::default()
        }
    }
}

/// The stress that the contours show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stress {
    /// The von Mises stress √(½((σ_xx − σ_yy)² + (σ_yy − σ_zz)² + (σ_zz − σ_xx)²) + 3σ_xy²).
    #[default]
    VonMises,
    /// The stress σ_xx (σ_rr).
    Xx,
    /// The stress σ_yy (σ_zz in axisymmetry).
    Yy,
    /// The stress σ_zz (σ_θθ in axisymmetry).
    Zz,
    /// The stress σ_xy (σ_rz).
    Xy,
}

impl FromStr for Stress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "von_mises" => Ok(Stress::VonMises),
            "xx" => Ok(Stress::Xx),
            "yy" => Ok(Stress::Yy),
            "zz" => Ok(Stress::Zz),
            "xy" => Ok(Stress::Xy),
            _ => Err("expected von_mises, xx, yy, zz or xy".to_owned()),
        }
    }
}
