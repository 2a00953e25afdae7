//! Which spheres inside a hand detect most collisions of two hands: written by `grasp-assets-generator screens`, not by
//! hand.

use super::InnerSphere;
use crate::physical::solids::SPHERES;

/// They miss 5.5 % of the collisions of known grips and givers.
pub(super) const FIRST: [InnerSphere; SPHERES] = [
    (2, 0.5),
    (7, 0.5),
    (13, 0.3),
    (5, 0.3),
    (26, 0.9),
    (11, 0.9),
    (3, 0.7),
    (22, 0.3),
];

/// With these as well, 1.9 % are missed.
pub(super) const SECOND: [InnerSphere; SPHERES] = [
    (8, 0.9),
    (1, 0.5),
    (14, 0.9),
    (2, 0.9),
    (29, 0.1),
    (12, 0.1),
    (30, 0.7),
    (5, 0.9),
];
