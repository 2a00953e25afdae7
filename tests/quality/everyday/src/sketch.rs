//! An object under construction from outlines and paths: bodies of revolution, sweeps, slabs and sheets, in millimetres.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use serde::Deserialize;

use crate::{
    about::{Fill, Part},
    mesh_builder::{MeshBuilder, Ring, sin_cos_degrees},
};

/// Radii in millimetres below which a ring is a point.
const POINT: f64 = 1e-6;

/// An object under construction. Shapes go to the part that was begun last, in the frame placed last.
pub(crate) struct Sketch {
    pub(crate) mesh: MeshBuilder,
    pub(crate) parts: Vec<Part>,
    pub(crate) is_closed: bool,
    frame: DAffine3,
}

impl Sketch {
    pub(crate) fn new() -> Self {
        Self {
            mesh: MeshBuilder::new(&[]),
            parts: Vec::new(),
            is_closed: true,
            frame: DAffine3::IDENTITY,
        }
    }

    /// Begins a part.
    pub(crate) fn part(&mut self, name: &'static str, fill: Fill) {
        self.mesh.group(name);
        self.parts.push(Part { name, fill });
    }

    /// Places the following shapes: their origin, the direction of their y axis, and how much they are stretched along their axes.
    pub(crate) fn place(&mut self, origin: DVec3, up: DVec3, stretch: DVec3) {
        let tilt = DQuat::from_rotation_arc(DVec3::Y, up.normalize());
        self.frame = DAffine3::from_rotation_translation(tilt, origin) * DAffine3::from_scale(stretch);
    }

    /// A body of revolution about the y axis. The profile of radii and heights goes from the bottom, outside, to
    /// where the surface ends on the axis; ends off the axis are closed by discs.
    pub(crate) fn lathe(&mut self, corners: usize, profile: &[[f64; 2]]) {
        let rings = profile.iter().map(|&[radius, height]| {
            let around = |corner: usize| {
                let (sin, cos) = sin_cos_degrees(360.0 * corner as f64 / corners as f64);
                DVec3::new(radius * cos, height, -radius * sin)
            };
            if radius < POINT {
                vec![DVec3::Y * height]
            } else {
                (0..corners).map(around).collect()
            }
        });
        let rings: Vec<_> = rings.collect();
        self.loft(&rings);
    }

    /// A surface through rings of equal length, each counter-clockwise about the direction of the next. A ring of one
    /// point closes the surface there; other ends are closed by fans from their middle.
    pub(crate) fn loft(&mut self, rings: &[Vec<DVec3>]) {
        let rings: Vec<Ring> = rings.iter().map(|ring| self.ring(ring)).collect();
        let group = self.group();
        for pair in rings.windows(2) {
            match (&pair[0][..], &pair[1][..]) {
                (&[apex], ring) => self.fan_below(ring, apex),
                (ring, &[apex]) => self.mesh.fan(ring, apex, |_| group),
                (from, to) => self.mesh.strip(from, to, |_| Some(group)),
            }
        }
        if let [first, .., last] = &rings[..] {
            if first.len() > 1 {
                let apex = self.middle(first);
                self.fan_below(first, apex);
            }
            if last.len() > 1 {
                let apex = self.middle(last);
                self.mesh.fan(last, apex, |_| group);
            }
        }
    }

    /// A slab of the size along x, y and z about the origin. Its outline in x and z has corners of radius `corner`, and
    /// its edges above and below are cut by `bevel`; both may be 0.
    pub(crate) fn slab(&mut self, size: DVec3, corner: f64, bevel: f64) {
        let half = size / 2.0;
        let outline = |inset: f64, height: f64| {
            outline(
                DVec2::new(half.x - inset, half.z - inset),
                (corner - inset).max(0.0),
                corner > 0.0,
            )
            .into_iter()
            .map(move |point| DVec3::new(point.x, height, point.y))
            .collect::<Vec<_>>()
        };
        if bevel > 0.0 {
            self.loft(&[
                outline(bevel, -half.y),
                outline(0.0, bevel - half.y),
                outline(0.0, half.y - bevel),
                outline(bevel, half.y),
            ]);
        } else {
            self.loft(&[outline(0.0, -half.y), outline(0.0, half.y)]);
        }
    }

    /// A rod along a path, closed by discs. Its elliptic section is half its size along `normal`, and across it, by the share of the
    /// path's points. `normal` must not be parallel to the path; for a path in a plane it is the plane's.
    pub(crate) fn tube(
        &mut self,
        path: &[DVec3],
        normal: DVec3,
        corners: usize,
        section: impl Fn(f64) -> [f64; 2],
    ) {
        let last = path.len() - 1;
        let rings: Vec<_> = (0..path.len())
            .map(|i| {
                let tangent = path[(i + 1).min(last)] - path[i.saturating_sub(1)];
                elliptic(path[i], tangent, normal, corners, section(i as f64 / last as f64))
            })
            .collect();
        self.loft(&rings);
    }

    /// A closed hoop of elliptic section: half its size along `normal`, and across it.
    pub(crate) fn hoop(&mut self, path: &[DVec3], normal: DVec3, corners: usize, section: [f64; 2]) {
        let count = path.len();
        let rings: Vec<Ring> = (0..count)
            .map(|i| {
                let tangent = path[(i + 1) % count] - path[(i + count - 1) % count];
                self.ring(&elliptic(path[i], tangent, normal, corners, section))
            })
            .collect();
        let group = self.group();
        for i in 0..count {
            self.mesh
                .strip(&rings[i], &rings[(i + 1) % count], |_| Some(group));
        }
    }

    /// A sheet of no thickness through rows of points of equal length.
    pub(crate) fn sheet(&mut self, rows: &[Vec<DVec3>]) {
        self.is_closed = false;
        let rows: Vec<Ring> = rows.iter().map(|row| self.ring(row)).collect();
        let group = self.group();
        for pair in rows.windows(2) {
            for i in 1..pair[0].len() {
                self.mesh
                    .quad(group, [pair[0][i - 1], pair[0][i], pair[1][i], pair[1][i - 1]]);
            }
        }
    }

    fn group(&self) -> &'static str {
        self.parts.last().expect("a shape belongs to a part").name
    }

    fn ring(&mut self, points: &[DVec3]) -> Ring {
        let frame = self.frame;
        self.mesh
            .ring(points.iter().map(|&point| frame.transform_point3(point)))
    }

    fn middle(&mut self, ring: &[usize]) -> usize {
        let sum: DVec3 = ring.iter().map(|&vertex| self.mesh.position(vertex)).sum();
        self.mesh.vertex(sum / ring.len() as f64)
    }

    /// Closes a ring with a point behind it.
    fn fan_below(&mut self, ring: &[usize], apex: usize) {
        let backward: Vec<_> = ring.iter().rev().copied().collect();
        let group = self.group();
        self.mesh.fan(&backward, apex, |_| group);
    }
}

/// A rounded rectangle in x and z, counter-clockwise about +y.
fn outline(half_size: DVec2, radius: f64, is_round: bool) -> Vec<DVec2> {
    /// Steps of a corner.
    const STEPS: usize = 4;
    let core = half_size - DVec2::splat(radius);
    let mut points = Vec::new();
    for (quarter, [x, z]) in [[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]
        .into_iter()
        .enumerate()
    {
        let middle = core * DVec2::new(x, z);
        let steps = if is_round { STEPS } else { 0 };
        for step in 0..=steps {
            let share = if is_round { step as f64 / STEPS as f64 } else { 0.5 };
            let (sin, cos) = sin_cos_degrees(90.0 * (quarter as f64 + share));
            points.push(middle + radius * DVec2::new(cos, -sin));
        }
    }
    points
}

/// An ellipse about a path, counter-clockwise about its direction.
fn elliptic(
    centre: DVec3,
    tangent: DVec3,
    normal: DVec3,
    corners: usize,
    [along, across]: [f64; 2],
) -> Vec<DVec3> {
    let tangent = tangent.normalize();
    let first = normal.reject_from_normalized(tangent).normalize();
    let second = tangent.cross(first);
    (0..corners)
        .map(|corner| {
            let (sin, cos) = sin_cos_degrees(360.0 * corner as f64 / corners as f64);
            centre + along * cos * first + across * sin * second
        })
        .collect()
}

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
