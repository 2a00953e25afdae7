//! Closed Mayo scissors (surgical), 16 cm long: two blades that cross at a screw, two shanks, two finger rings.
//!
//! One closed surface with two holes. Every cross-section has eight vertices; the surface forks once behind the screw
//! and once at each finger ring, whose ends meet again at the fork.

use glam::{DVec2, DVec3};
use grasp_mesh_builder::{MeshBuilder, Ring, Shape, fork, sin_cos_degrees};

/// The only group.
const BODY: &str = "body";

/// A cross-section of the two closed blades, in millimetres. The upper blade reaches from its back on the left to its
/// edge right of the middle, the lower one mirrored through the long axis.
struct BladeSection {
    /// Along the long axis, from the screw.
    y: f64,
    /// From the middle to a blade's back.
    back: f64,
    /// From the middle to a blade's edge, which lies over the other blade.
    edge: f64,
    /// A blade's thickness at its back.
    thickness: f64,
}

/// From the tip to the screw.
const BLADES: [BladeSection; 4] = [
    BladeSection {
        y: 61.0,
        back: 1.7,
        edge: 0.8,
        thickness: 1.0,
    },
    BladeSection {
        y: 50.0,
        back: 3.6,
        edge: 1.5,
        thickness: 1.4,
    },
    BladeSection {
        y: 33.0,
        back: 5.2,
        edge: 2.2,
        thickness: 1.8,
    },
    BladeSection {
        y: 14.0,
        back: 6.4,
        edge: 2.6,
        thickness: 2.1,
    },
];

/// Tip of the closed blades from the screw, in millimetres.
const TIP_Y: f64 = 65.0;

/// Cross-sections of the flat box around the screw: y, half width and half thickness in millimetres.
const BOX: [[f64; 3]; 4] = [
    [6.5, 6.9, 2.3],
    [0.0, 7.4, 2.4],
    [-6.5, 6.8, 2.4],
    [-11.5, 5.2, 2.3],
];

/// A shank's cross-sections: centre x and y, half width, half thickness, and how far its middle is above the
/// scissors' middle plane, in millimetres. The right shank belongs to the upper blade.
const SHANK: [[f64; 5]; 3] = [
    [3.5, -18.0, 2.5, 2.1, 0.5],
    [4.5, -31.0, 2.1, 1.9, 0.3],
    [8.2, -45.5, 2.2, 2.1, 0.1],
];

/// Centre of the right finger ring, in millimetres.
const RING_CENTRE: DVec2 = DVec2::new(17.7, -73.0);

/// How far the ring's long axis leans outward, in line with the shank, in degrees.
const RING_LEAN_DEGREES: f64 = 10.0;

/// Half axes of the finger ring's middle line in millimetres. Less the band's half width they leave a hole of
/// 23 by 33 mm, which a finger of the 95th percentile (about 20 mm at the knuckle) fits through.
const RING_HALF_AXES: DVec2 = DVec2::new(13.9, 18.9);

/// Half width and half thickness of the finger ring's band in millimetres.
const BAND: DVec2 = DVec2::new(2.4, 2.2);

/// Where on the ring the shank meets it, in degrees from the ring's short axis on the right.
const RING_FORK_DEGREES: f64 = 106.0;

/// How far from the fork, in degrees, the ring's own cross-sections begin.
const RING_START_DEGREES: f64 = 33.0;

/// The ring's own cross-sections.
const RING_SECTIONS: usize = 9;

/// The mesh.
pub(crate) fn build() -> Shape {
    let mut mesh = MeshBuilder::new(&[BODY]);
    let whole = |_: usize| Some(BODY);

    // The blades, from the tip backward.
    let mut last: Option<Ring> = None;
    for section in &BLADES {
        let ring = mesh.ring(blade_section(section));
        if let Some(before) = &last {
            mesh.strip(before, &ring, whole);
        } else {
            // The tip lies behind this ring, so the fan runs the other way.
            let tip = mesh.vertex(DVec3::new(0.0, TIP_Y, 0.0));
            let reversed: Ring = ring.iter().rev().copied().collect();
            mesh.fan(&reversed, tip, |_| BODY);
        }
        last = Some(ring);
    }

    // The box, with a hole on its upper side for the screw.
    let rings =
        BOX.map(|[y, half_width, half_thickness]| mesh.ring(box_section(y, half_width, half_thickness)));
    mesh.strip(&last.expect("there are blade sections"), &rings[0], whole);
    for pair in rings.windows(2).take(2) {
        mesh.strip(&pair[0], &pair[1], |k| (k != 2 && k != 3).then_some(BODY));
    }
    mesh.strip(&rings[2], &rings[3], whole);
    screw(&mut mesh, [&rings[0], &rings[1], &rings[2]]);

    // The fork between the shanks: from the upper middle over the crotch to the lower middle.
    let crotch = mesh.ring([(-13.5, 1.7), (-15.0, 0.0), (-13.5, -1.7)].map(|(y, z)| DVec3::new(0.0, y, z)));
    let (right, left) = fork(&rings[3], 7, 3, &crotch);
    handle(&mut mesh, right, 1.0);
    handle(&mut mesh, left, -1.0);
    mesh.finish()
}

/// The outline of both blades, lying on each other.
fn blade_section(section: &BladeSection) -> [DVec3; 8] {
    let &BladeSection {
        y,
        back,
        edge,
        thickness,
    } = section;
    // A blade thins toward its edge.
    let thin = 0.45 * thickness;
    [
        (back, -thickness),
        (back, 0.0),
        (edge, 0.0),
        (edge, thin),
        (-back, thickness),
        (-back, 0.0),
        (-edge, 0.0),
        (-edge, -thin),
    ]
    .map(|(x, z)| DVec3::new(x, y, z))
}

/// The outline of the box: flat above and below, blunt at the sides.
fn box_section(y: f64, half_width: f64, half_thickness: f64) -> [DVec3; 8] {
    let flat = 0.78 * half_width;
    [
        (flat, -half_thickness),
        (half_width, 0.0),
        (flat, half_thickness),
        (0.0, half_thickness),
        (-flat, half_thickness),
        (-half_width, 0.0),
        (-flat, -half_thickness),
        (0.0, -half_thickness),
    ]
    .map(|(x, z)| DVec3::new(x, y, z))
}

/// The head of the screw on the box's upper side.
fn screw(mesh: &mut MeshBuilder, rings: [&Ring; 3]) {
    const RADIUS_MM: f64 = 3.4;
    const HEIGHT_MM: f64 = 1.0;
    let [front, middle, rear] = rings;
    // The hole's rim, counter-clockwise seen from above, starting in the middle of the rear.
    let rim = [
        rear[3], rear[2], middle[2], front[2], front[3], front[4], middle[4], rear[4],
    ];
    let surface = mesh.position(middle[3]).z;
    let mut circle = |radius: f64, z: f64| -> Ring {
        mesh.ring((0..8).map(|k| {
            let (sine, cosine) = sin_cos_degrees(-90.0 + 45.0 * f64::from(k));
            DVec3::new(radius * cosine, radius * sine, z)
        }))
    };
    let foot = circle(RADIUS_MM, surface);
    let head = circle(0.85 * RADIUS_MM, surface + HEIGHT_MM);
    mesh.strip(&rim, &foot, |_| Some(BODY));
    mesh.strip(&foot, &head, |_| Some(BODY));
    mesh.cap(BODY, &head);
}

/// A shank with its finger ring; `side` is 1 for the right one and −1 for the left one, which is its mirror image by
/// half a turn about the long axis.
fn handle(mesh: &mut MeshBuilder, start: Ring, side: f64) {
    let turned = |point: DVec3| DVec3::new(side * point.x, point.y, side * point.z);
    let whole = |_: usize| Some(BODY);

    let mut last = start;
    let ends = SHANK.map(|[x, y, ..]| DVec2::new(x, y));
    for (index, &[x, y, half_width, half_thickness, z]) in SHANK.iter().enumerate() {
        let before = if index == 0 {
            DVec2::new(2.8, -10.0)
        } else {
            ends[index - 1]
        };
        let after = ends
            .get(index + 1)
            .copied()
            .unwrap_or(ring_point(RING_FORK_DEGREES));
        let section = section(
            DVec3::new(x, y, z),
            after - before,
            DVec2::new(half_width, half_thickness),
        );
        let ring = mesh.ring(section.map(turned));
        mesh.strip(&last, &ring, whole);
        last = ring;
    }

    // The ring forks at the shank: the crotch is the inner side of the band.
    let fork_point = ring_point(RING_FORK_DEGREES);
    let inward = (RING_CENTRE - fork_point).normalize_or_zero();
    let crotch = mesh.ring(
        [(0.55, 0.8), (1.0, 0.0), (0.55, -0.8)]
            .map(|(depth, height)| (fork_point + inward * (depth * BAND.x)).extend(height * BAND.y))
            .map(turned),
    );
    let (mut branch, other) = fork(&last, 0, 4, &crotch);
    let span = 360.0 - 2.0 * RING_START_DEGREES;
    for index in 0..RING_SECTIONS {
        let degrees =
            RING_FORK_DEGREES - RING_START_DEGREES - span * index as f64 / (RING_SECTIONS - 1) as f64;
        let (sine, cosine) = sin_cos_degrees(degrees);
        // Clockwise, so that the outside of the ring is on the left.
        let forward = leaning(DVec2::new(sine, -cosine) * RING_HALF_AXES);
        let section = section(ring_point(degrees).extend(0.0), forward, BAND);
        let ring = mesh.ring(section.map(turned));
        mesh.strip(&branch, &ring, whole);
        branch = ring;
    }
    // The other branch starts where this one ends, seen from the other direction.
    let end: Ring = (0..8).map(|k| other[(12 - k) % 8]).collect();
    mesh.strip(&branch, &end, whole);
}

/// A point of the right finger ring's middle line.
fn ring_point(degrees: f64) -> DVec2 {
    let (sine, cosine) = sin_cos_degrees(degrees);
    RING_CENTRE + leaning(RING_HALF_AXES * DVec2::new(cosine, sine))
}

/// Turns a direction along the ring's axes as the right ring leans.
fn leaning(along_axes: DVec2) -> DVec2 {
    let (sine, cosine) = sin_cos_degrees(RING_LEAN_DEGREES);
    DVec2::new(cosine, sine).rotate(along_axes)
}

/// An octagon across `forward`, counter-clockwise about it, starting at its lowest vertex.
fn section(centre: DVec3, forward: DVec2, half_size: DVec2) -> [DVec3; 8] {
    let left = DVec2::new(-forward.y, forward.x).normalize_or_zero();
    std::array::from_fn(|k| {
        let (sine, cosine) = sin_cos_degrees(-90.0 + 45.0 * k as f64);
        centre + (left * (half_size.x * cosine)).extend(half_size.y * sine)
    })
}
