//! Outlines and paths, in millimetres.

use crate::mesh_builder::sin_cos_degrees;
use glam::{DMat3, DVec3};
use serde::Deserialize;

/// An arc around a centre, both ends included.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Arc {
    centre: DVec3,
    radius: f64,
    /// First and last angle in degrees, from `across` toward `along`.
    angles: [f64; 2],
    steps: usize,
    #[serde(default = "x_axis")]
    across: DVec3,
    #[serde(default = "y_axis")]
    along: DVec3,
}

/// An ellipse, from the first of its semi-axes toward the second.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Ellipse {
    #[serde(default)]
    centre: DVec3,
    axes: [DVec3; 2],
    steps: usize,
}

/// An outline by a Fourier series: its radius at angle a is `mean` + Σ `cos`ₖ cos ka + `sin`ₖ sin ka, k from 1.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Outline {
    mean: f64,
    cos: Vec<f64>,
    sin: Vec<f64>,
    steps: usize,
}

pub(crate) fn x_axis() -> DVec3 {
    DVec3::X
}

pub(crate) fn y_axis() -> DVec3 {
    DVec3::Y
}

pub(crate) fn z_axis() -> DVec3 {
    DVec3::Z
}

impl Arc {
    pub(crate) fn points(&self) -> impl Iterator<Item = DVec3> {
        let [from, to] = self.angles;
        (0..=self.steps).map(move |step| {
            let (sin, cos) = sin_cos_degrees(from + (to - from) * step as f64 / self.steps as f64);
            self.centre + self.radius * (cos * self.across + sin * self.along)
        })
    }
}

impl Ellipse {
    /// Its points, without repeating the first.
    pub(crate) fn points(&self) -> Vec<DVec3> {
        let [across, along] = self.axes;
        (0..self.steps)
            .map(|step| {
                let (sin, cos) = sin_cos_degrees(360.0 * step as f64 / self.steps as f64);
                self.centre + cos * across + sin * along
            })
            .collect()
    }

    /// The normal of its plane.
    pub(crate) fn normal(&self) -> DVec3 {
        self.axes[0].normalize().cross(self.axes[1].normalize())
    }
}

impl Outline {
    /// Its points in x and y, moved inward by `inset`, at `z`.
    pub(crate) fn points(&self, inset: f64, z: f64) -> Vec<DVec3> {
        let around = |step: usize| {
            let angle = 360.0 * step as f64 / self.steps as f64;
            let cosines = self.cos.iter().zip(1..).map(|(c, k)| c * at(k, angle).1);
            let sines = self.sin.iter().zip(1..).map(|(s, k)| s * at(k, angle).0);
            let radius = self.mean + cosines.sum::<f64>() + sines.sum::<f64>() - inset;
            let (sin, cos) = sin_cos_degrees(angle);
            DVec3::new(radius * cos, radius * sin, z)
        };
        (0..self.steps).map(around).collect()
    }
}

/// Sine and cosine of a multiple of an angle in degrees.
fn at(multiple: u8, angle: f64) -> (f64, f64) {
    sin_cos_degrees(f64::from(multiple) * angle)
}

/// A turn about the y axis by an angle in degrees.
pub(crate) fn turned(angle: f64) -> DMat3 {
    let (sin, cos) = sin_cos_degrees(angle);
    DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos))
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
pub(crate) fn rod([radius, bottom, top]: [f64; 3]) -> Vec<[f64; 2]> {
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
