//! A scalpel: handle no. 3 (flat, waisted, with cross grooves where the fingers hold it) and blade no. 10 (straight
//! back, curved belly), 15.6 cm long together.
//!
//! One loft along the long axis with 16 vertices per cross-section. The blade's edge looks toward +X.

use glam::{DVec2, DVec3};
use grasp_mesh_builder::{MeshBuilder, Ring, Shape, on_rounded_rectangle, sin_cos_degrees};

/// Handle and the blade's flats.
const BODY: &str = "body";

/// The ground bevels on both sides of the blade and the edge between them.
const BLADE_EDGE: &str = "blade_edge";

/// Cross-sections of the handle from the butt to the grooves: y, half width, half thickness, corner radius, in
/// millimetres from the middle of the heft.
const HEFT: [[f64; 4]; 8] = [
    [-61.0, 2.6, 0.7, 0.5],
    [-60.4, 3.9, 1.2, 0.7],
    [-58.5, 4.9, 1.5, 0.8],
    [-55.0, 5.2, 1.6, 0.8],
    [-40.0, 4.9, 1.6, 0.8],
    [-20.0, 4.2, 1.6, 0.8],
    [5.0, 3.7, 1.6, 0.8],
    [24.0, 4.3, 1.6, 0.8],
];

/// The cross grooves: how many, where the first begins, their spacing and their depth, in millimetres.
const GROOVES: usize = 5;
const GROOVES_Y: f64 = 25.5;
const GROOVE_SPACING: f64 = 4.0;
const GROOVE_DEPTH: f64 = 0.4;

/// Half width and half thickness of the handle at the grooves, in millimetres.
const GRIP: [f64; 2] = [4.5, 1.6];

/// From the grooves to the nose that carries the blade; columns as in [`HEFT`].
const NOSE: [[f64; 4]; 5] = [
    [47.0, 4.4, 1.6, 0.8],
    [51.0, 3.9, 1.5, 0.7],
    [55.0, 2.9, 1.2, 0.6],
    [58.5, 2.3, 1.0, 0.5],
    [61.5, 2.2, 0.9, 0.5],
];

/// Where the blade begins, where its belly begins to curve, and its tip, in millimetres.
const BLADE_Y: [f64; 3] = [62.0, 79.0, 95.0];

/// Half width of the blade and half its thickness in millimetres. Real blades are 0.4 mm thick.
const BLADE: [f64; 2] = [3.5, 0.22];

/// Width of the ground bevel in millimetres, and half the thickness that is left at the edge.
const BEVEL: f64 = 1.8;
const EDGE_HALF_THICKNESS: f64 = 0.04;

/// Cross-sections in the belly's curve, and the angle between them on its quarter ellipse.
const BELLY_SECTIONS: usize = 9;
const BELLY_STEP_DEGREES: f64 = 9.0;

/// The mesh.
pub(crate) fn build() -> Shape {
    let mut mesh = MeshBuilder::new(&[BODY, BLADE_EDGE]);
    let mut last: Option<Ring> = None;
    let mut handle = |mesh: &mut MeshBuilder, [y, half_width, half_thickness, radius]: [f64; 4]| {
        let ring = mesh.ring(handle_section(y, DVec2::new(half_width, half_thickness), radius));
        match &last {
            Some(before) => mesh.strip(before, &ring, |_| Some(BODY)),
            None => mesh.cap(BODY, &ring.iter().rev().copied().collect::<Ring>()),
        }
        last = Some(ring);
    };
    for section in HEFT {
        handle(&mut mesh, section);
    }
    for groove in 0..GROOVES {
        let y = GROOVES_Y + GROOVE_SPACING * groove as f64;
        let [half_width, half_thickness] = GRIP;
        for (along, depth) in [(0.0, 0.0), (0.8, 1.0), (1.8, 1.0), (2.6, 0.0)] {
            let depth = depth * GROOVE_DEPTH;
            handle(
                &mut mesh,
                [y + along, half_width - depth, half_thickness - depth, 0.8],
            );
        }
    }
    for section in NOSE {
        handle(&mut mesh, section);
    }
    let mut last = last.expect("the handle has sections");

    let [heel, belly, tip] = BLADE_Y;
    let [half_width, _] = BLADE;
    let straight = [heel, heel + 2.0, heel + 8.0, belly].map(|y| (y, half_width));
    let curved = (1..=BELLY_SECTIONS).map(|step| {
        let (sine, cosine) = sin_cos_degrees(BELLY_STEP_DEGREES * step as f64);
        (belly + (tip - belly) * sine, half_width * (2.0 * cosine - 1.0))
    });
    for (index, (y, edge)) in straight.into_iter().chain(curved).enumerate() {
        let ring = mesh.ring(blade_section(y, edge));
        mesh.strip(&last, &ring, |k| {
            Some(if index == 0 { BODY } else { blade_group(k) })
        });
        last = ring;
    }
    let apex = mesh.vertex(DVec3::new(-half_width, tip, 0.0));
    mesh.fan(&last, apex, blade_group);
    mesh.finish()
}

/// The group of the quad that follows vertex `k` of a blade's cross-section.
fn blade_group(k: usize) -> &'static str {
    if matches!(k, 0 | 1 | 13 | 14 | 15) {
        BLADE_EDGE
    } else {
        BODY
    }
}

/// A rounded rectangle, counter-clockwise about +y: from the side at +x over −z.
fn handle_section(y: f64, half_size: DVec2, radius: f64) -> [DVec3; 16] {
    std::array::from_fn(|k| {
        // Four vertices per corner, 30° apart on its arc.
        let (sine, cosine) = sin_cos_degrees(90.0 * (k / 4) as f64 + 30.0 * (k % 4) as f64);
        let corner = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][k / 4];
        let core = (half_size - DVec2::splat(radius)) * DVec2::from(corner);
        let point = on_rounded_rectangle(core + DVec2::new(cosine, sine) * radius, half_size, radius);
        DVec3::new(point.x, y, -point.y)
    })
}

/// A blade's cross-section from its edge at `edge` to its back; the vertices correspond to those of the handle.
fn blade_section(y: f64, edge: f64) -> [DVec3; 16] {
    let [half_width, half_thickness] = BLADE;
    let width = half_width + edge;
    // Toward the tip the bevels shrink with the blade.
    let bevel = BEVEL.min(0.45 * width);
    let flat = width - bevel;
    let upper = [
        (edge, EDGE_HALF_THICKNESS),
        (edge - 0.5 * bevel, 0.5 * (EDGE_HALF_THICKNESS + half_thickness)),
        (edge - bevel, half_thickness),
        (edge - bevel - 0.25 * flat, half_thickness),
        (edge - bevel - 0.5 * flat, half_thickness),
        (edge - bevel - 0.75 * flat, half_thickness),
        (edge - bevel - 0.97 * flat, half_thickness),
        (-half_width, 0.5 * half_thickness),
    ];
    std::array::from_fn(|k| {
        let (x, height) = if k < 8 { upper[k] } else { upper[15 - k] };
        DVec3::new(x, y, if k < 8 { -height } else { height })
    })
}
