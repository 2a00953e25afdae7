//! Algorithm 1 of the thesis (`TRYSYNTHESIZEGRASP`) and its five steps, under strategies A to F.
//!
//! | Algorithm of the thesis | Module |
//! |---|---|
//! | 1 `TRYSYNTHESIZEGRASP` | [`algorithm_1`] |
//! | 2 `PLACEWRISTFRAME`, 11 modified | [`wrist_placement`], measures in [`placement_measures`] |
//! | 3 `CALCULATEHOLDPOSEANDCONTACTS`, 12 modified | [`algorithm_1`], [`finger_posing`] |
//! | 4 `FINDTOUCHINGFINGERPOSE`, 13 modified | [`finger_posing`], tables in [`closing_motion`] |
//! | 5 `GRASPINGCONTACTSEXIST` | [`finger_posing`] |
//! | 6 `COLLIDESWITHMESH` | [`collision_validation`] |
//! | 7 `COLLIDESWITHFORBIDDENSURFACE` | [`contact_validation`] |
//! | 8 `FOURUNITWRENCHESFROMCONTACT` | [`wrenches`] |
//! | 9 `ISIMMOBILIZINGGRASP`, 14 modified | [`immobility_validation`] |
//! | 10 `FORCEDISTRIBUTIONSOVERCONTACTS` | [`force_distribution`] |
//!
//! Invariants: a rejected attempt allocates nothing; the clock is read only through a
//! [`crate::base::stopwatch::Stopwatch`]; an attempt's outcome depends only on the scene, the seed and the attempt index.

pub mod algorithm_1;
pub mod collision_and_contact_validation;
pub mod finger_posing;
pub mod immobility_validation;
pub mod wrist_placement;
