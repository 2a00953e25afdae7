//! Colours that people with protanopia, deuteranopia or tritanopia can distinguish: any two of a set are at least 15
//! apart in CIELAB for each of them, and for everyone else.
//!
//! Most are from the palette of Okabe and Ito ("Color Universal Design", 2008), some from the muted and bright schemes
//! of Tol ("Colour Schemes", SRON/EPS/TN/09-002, 2021).

use super::Colour;

/// Green: valid grasps, as in the thesis (Figure 5.10).
pub const VALID: Colour = Colour(0, 158, 115);

/// The rejections in the order of the thesis' Table 5.2: `NoContacts`, `NoThumb`, `NoThumbEarlyStop`, `NoFingers`,
/// `PalmCollision`, `FingerCollision`, `UnwantedContact`, `NotImmobilizing`. With [`VALID`], these are the nine output
/// types.
pub const REJECTIONS: [Colour; 8] = [
    Colour(230, 159, 0),
    Colour(86, 180, 233),
    Colour(0, 114, 178),
    Colour(204, 121, 167),
    Colour(213, 94, 0),
    Colour(221, 204, 119),
    Colour(102, 102, 51),
    Colour(136, 34, 85),
];

/// Orange: grasps without contacts where all other rejections are one kind (Figure 5.10).
pub const NO_CONTACTS: Colour = REJECTIONS[0];

/// Dark blue: the rejections except `NoContacts`, as one kind (Figure 5.10).
pub const OTHER_REJECTIONS: Colour = Colour(28, 40, 110);

/// The steps of an attempt: wrist placement, finger posing, collision validation, contact validation, immobility
/// validation.
pub const STEPS: [Colour; 5] = [
    Colour(86, 180, 233),
    Colour(0, 114, 178),
    Colour(213, 94, 0),
    Colour(240, 228, 66),
    Colour(136, 34, 85),
];

/// The bend ratios 0.7, 1 and 1.42: purple, green and blue, as in the thesis (Figure 5.15), apart in lightness too.
pub const BEND_RATIOS: [Colour; 3] = [Colour(93, 26, 117), Colour(34, 136, 51), Colour(86, 180, 233)];

/// Blue: measured here, next to [`THESIS`].
pub const HERE: Colour = Colour(0, 114, 178);

/// Grey: measured by the thesis.
pub const THESIS: Colour = Colour(187, 187, 187);

/// Dark blue: measured here on more than one thread.
pub const HERE_ON_MORE_THREADS: Colour = Colour(28, 40, 110);
