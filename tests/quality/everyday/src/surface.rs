//! Friction of skin on what things are made of.

use serde::Deserialize;

/// What a hand touches. Coefficients are static, of dry or slightly moist fingers that press with a few newtons to some
/// tens; the README names their sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Surface {
    /// Bare or lacquered metal.
    Metal,
    /// Glass and glazed china.
    Glass,
    /// Smooth or grained plastic.
    Plastic,
    /// Rubber and soft handles.
    Rubber,
    /// Wood, planed or lacquered.
    Wood,
    /// Paper, card and cardboard.
    Paper,
    /// Woven or felted cloth.
    Cloth,
    /// Leather.
    Leather,
    /// Bricks and what else is as rough as sandpaper.
    Rough,
    /// Fruit, eggshell, leaves, wax.
    Natural,
}

impl Surface {
    /// The coefficient of static friction.
    pub fn friction(self) -> f64 {
        match self {
            // Between 0.38, pinched with 20 to 39 N (Buchholz 1988), and 0.6 at 1 to 20 N (Seo 2009).
            Self::Metal => 0.49,
            // As smooth and tight as metal; the upper of the two figures, because moisture stays.
            Self::Glass => 0.6,
            // Smooth vinyl (Buchholz 1988).
            Self::Plastic => 0.53,
            // Rubber hoses (Seo 2009).
            Self::Rubber => 0.9,
            // Textured vinyl (Buchholz 1988).
            Self::Wood | Self::Natural => 0.5,
            // Between 0.27 dry and 0.42 moist (Buchholz 1988).
            Self::Paper => 0.35,
            // Cotton (Zhang and Mak 1999).
            Self::Cloth => 0.51,
            // Suede, between 0.39 dry and 0.66 moist (Buchholz 1988).
            Self::Leather => 0.52,
            // Sandpaper (Buchholz 1988).
            Self::Rough => 0.61,
        }
    }

    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Metal => "metal",
            Self::Glass => "glass",
            Self::Plastic => "plastic",
            Self::Rubber => "rubber",
            Self::Wood => "wood",
            Self::Paper => "paper",
            Self::Cloth => "cloth",
            Self::Leather => "leather",
            Self::Rough => "rough",
            Self::Natural => "natural",
        }
    }
}
