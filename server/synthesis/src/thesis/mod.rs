//! Algorithm 1 of the thesis (`TRYSYNTHESIZEGRASP`) and its five steps, under strategies A to F.
//!
//! | Algorithm of the thesis | Step | Module |
//! |---|---|---|
//! | 1 `TRYSYNTHESIZEGRASP` | all | [`algorithm_1`] |
//! | 2 `PLACEWRISTFRAME`, 11 modified | 1 Wrist Placement | [`wrist_placement`] |
//! | 3 `CALCULATEHOLDPOSEANDCONTACTS`, 12 modified | 2 Finger Posing | [`algorithm_1`], [`finger_posing`] |
//! | 4 `FINDTOUCHINGFINGERPOSE`, 13 modified | 2 Finger Posing | [`finger_posing`] |
//! | 5 `GRASPINGCONTACTSEXIST` | 2 Finger Posing | [`finger_posing`] |
//! | 6 `COLLIDESWITHMESH` | 3 Collision Validation | [`collision_and_contact_validation`] |
//! | 7 `COLLIDESWITHFORBIDDENSURFACE` | 4 Contact Validation | [`collision_and_contact_validation`] |
//! | 8 `FOURUNITWRENCHESFROMCONTACT` | 5 Immobility Validation | [`immobility_validation`] |
//! | 9 `ISIMMOBILIZINGGRASP`, 14 modified | 5 Immobility Validation | [`immobility_validation`] |
//! | 10 `FORCEDISTRIBUTIONSOVERCONTACTS` | 5 Immobility Validation | [`immobility_validation`] |
//!
//! Invariants: a rejected attempt allocates nothing; the clock is read only through a
//! [`crate::base::stopwatch::Stopwatch`]; an attempt's outcome depends only on the scene, the seed and the attempt index.

pub mod algorithm_1;
pub mod collision_and_contact_validation;
pub mod finger_posing;
pub mod immobility_validation;
pub mod wrist_placement;
