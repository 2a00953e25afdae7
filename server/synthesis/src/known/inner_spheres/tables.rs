//! Which spheres inside a hand detect most collisions of two hands: written by `grasp-assets-generator screens`, not by
//! hand.

use super::InnerSphere;
use crate::physical::solids::SPHERES;

/// They miss 6.7 % of the collisions of known grips and givers.
pub(super) const FIRST: [InnerSphere; SPHERES] = [
    (2, 0.5),
    (7, 0.5),
    (9, 0.3),
    (5, 0.1),
    (11, 0.9),
    (25, 0.1),
    (14, 0.5),
    (3, 0.7),
];

/// With these as well, 2.0 % are missed.
pub(super) const SECOND: [InnerSphere; SPHERES] = [
    (8, 0.9),
    (29, 0.1),
    (1, 0.5),
    (5, 0.9),
    (22, 0.9),
    (2, 0.9),
    (12, 0.9),
    (30, 0.9),
];
