//! Which spheres inside a hand detect most collisions of two hands: written by `grasp-assets-generator screens`, not by
//! hand.

use super::InnerSphere;
use crate::physical::solids::SPHERES;

/// They miss 6.7 % of the collisions of known grips and givers.
pub(super) const FIRST: [InnerSphere; SPHERES] = [
    (2, 0.5),
    (7, 0.7),
    (9, 0.5),
    (5, 0.1),
    (25, 0.3),
    (11, 0.9),
    (14, 0.3),
    (3, 0.7),
];

/// With these as well, 2.2 % are missed.
pub(super) const SECOND: [InnerSphere; SPHERES] = [
    (22, 0.1),
    (8, 0.9),
    (1, 0.7),
    (2, 0.9),
    (5, 0.9),
    (29, 0.7),
    (12, 0.3),
    (29, 0.3),
];
