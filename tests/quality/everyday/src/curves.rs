//! Outlines and paths, in millimetres.

use glam::DVec3;
use grasp_mesh_builder::sin_cos_degrees;

/// Points of an arc around `centre`, from angle to angle in degrees in the plane of two unit vectors, both ends included.
pub(crate) fn arc(
    centre: DVec3,
    radius: f64,
    [from, to]: [f64; 2],
    steps: usize,
    [across, along]: [DVec3; 2],
) -> Vec<DVec3> {
    (0..=steps)
        .map(|step| {
            let (sin, cos) = sin_cos_degrees(from + (to - from) * step as f64 / steps as f64);
            centre + radius * (cos * across + sin * along)
        })
        .collect()
}

/// Points of an ellipse, without repeating the first, from `across` toward `along`; the vectors are the semi-axes.
pub(crate) fn ellipse(centre: DVec3, across: DVec3, along: DVec3, steps: usize) -> Vec<DVec3> {
    (0..steps)
        .map(|step| {
            let (sin, cos) = sin_cos_degrees(360.0 * step as f64 / steps as f64);
            centre + cos * across + sin * along
        })
        .collect()
}

/// An open line through `corners` with its inner corners cut round, `reach` before and after each.
pub(crate) fn rounded(corners: &[DVec3], reach: f64) -> Vec<DVec3> {
    /// Points in place of a corner.
    const STEPS: usize = 6;
    let mut path = vec![corners[0]];
    for window in corners.windows(3) {
        let [before, corner, after] = [window[0], window[1], window[2]];
        let start = corner + (before - corner).normalize() * reach;
        let end = corner + (after - corner).normalize() * reach;
        path.extend((0..=STEPS).map(|step| {
            let share = step as f64 / STEPS as f64;
            start.lerp(corner, share).lerp(corner.lerp(end, share), share)
        }));
    }
    path.extend(corners.last());
    path
}

/// Profile of a ball about the origin: radius and height of its rings from pole to pole.
pub(crate) fn ball(radius: f64) -> Vec<[f64; 2]> {
    /// Rings from pole to pole.
    const STEPS: usize = 16;
    (0..=STEPS)
        .map(|step| {
            let (sin, cos) = sin_cos_degrees(180.0 * step as f64 / STEPS as f64);
            [radius * sin, -radius * cos]
        })
        .collect()
}

/// Profile of a rod along the axis with rounded ends.
pub(crate) fn rod(radius: f64, [bottom, top]: [f64; 2]) -> Vec<[f64; 2]> {
    let bevel = 0.4 * radius;
    vec![
        [radius - bevel, bottom],
        [radius, bottom + bevel],
        [radius, top - bevel],
        [radius - bevel, top],
    ]
}

/// Profile of a vessel with walls of even thickness, open at the top: out along the bottom, up, over the rim and down.
pub(crate) fn vessel(outer: &[[f64; 2]], wall: f64) -> Vec<[f64; 2]> {
    let floor = outer[0][1] + wall;
    let inner = outer.iter().rev().map(|&[radius, height]| {
        [
            (radius - wall).max(0.0),
            if height < floor { floor } else { height },
        ]
    });
    outer.iter().copied().chain(inner).collect()
}
