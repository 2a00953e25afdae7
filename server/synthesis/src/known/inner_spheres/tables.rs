//! Which spheres inside a hand detect most collisions of two hands: chosen once by a greedy cover, as `assets/PROVENANCE.md` says.

use super::InnerSphere;
use crate::physical::solids::SPHERES;

/// They miss 6.4 % of the collisions of known grips and givers.
pub(super) const FIRST: [InnerSphere; SPHERES] = [
    (2, 0.5),
    (7, 0.5),
    (12, 0.9),
    (5, 0.1),
    (11, 0.9),
    (25, 0.7),
    (22, 0.9),
    (3, 0.9),
];

/// With these as well, 2.2 % are missed.
pub(super) const SECOND: [InnerSphere; SPHERES] = [
    (8, 0.9),
    (14, 0.9),
    (29, 0.1),
    (2, 0.9),
    (5, 0.9),
    (30, 0.7),
    (3, 0.1),
    (1, 0.7),
];
