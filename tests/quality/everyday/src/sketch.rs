//! An object under construction: bodies of revolution, sweeps, slabs and sheets, in millimetres.

use crate::mesh_builder::{MeshBuilder, Ring, sin_cos_degrees};
use glam::{DAffine3, DQuat, DVec2, DVec3};

use crate::about::{Fill, Part};

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

    /// Places what follows: its origin, the direction of its y axis, and how much it is stretched along its axes.
    pub(crate) fn place(&mut self, origin: DVec3, up: DVec3, stretch: DVec3) {
        let tilt = DQuat::from_rotation_arc(DVec3::Y, up.normalize());
        self.frame = DAffine3::from_rotation_translation(tilt, origin) * DAffine3::from_scale(stretch);
    }

    /// A body of revolution about the y axis with so many corners. The profile of radii and heights goes from the bottom, outside, to
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
