//! Charts: where dots and bars lie, what the words say.

mod bars;
mod dots;
mod figures;
mod palettes;
mod soundness;
