//! Shapes like things that hands hold: boxes, rods and bottles, cups with and without a stem, and flattened eggs. Their
//! sizes are distributed evenly on a logarithmic scale.

use std::f32::consts::TAU;

use glam::Vec3;
use grasp_synthesis::{
    base::random::AttemptStream, geometry::mesh::TriangleMesh, model::object::GraspObject,
};

/// Seed of the shapes: any will do.
const SEED: u64 = 0x5348_4150;

/// Masses in kilograms.
const MASSES: [f32; 2] = [0.03, 0.35];

/// Corners of a round shape's rings, and rings.
const CORNERS: usize = 20;
const RINGS: usize = 12;

/// Share of cups with a foot and a stem.
const STEMMED: f32 = 0.4;

/// A ring of a round shape: its radius and its height in metres.
type Ring = (f32, f32);

/// The shape of a number.
pub(crate) fn draw(number: u64) -> GraspObject {
    let mut stream = AttemptStream::new(SEED, number);
    let mesh = match number % 4 {
        0 => cuboid(&mut stream),
        1 => rod(&mut stream),
        2 => cup(&mut stream),
        _ => egg(&mut stream),
    };
    let mass = stream.between(MASSES[0], MASSES[1]);
    let centre = mesh.volume_centroid().expect("a shape that is drawn is closed");
    GraspObject::new(mesh, mass, centre, None, &[]).expect("a shape that is drawn is sound")
}

/// A length in metres.
fn length(stream: &mut AttemptStream, least: f32, most: f32) -> f32 {
    least * (most / least).powf(stream.unit())
}

fn cuboid(stream: &mut AttemptStream) -> TriangleMesh {
    let size = Vec3::new(
        length(stream, 0.003, 0.06),
        length(stream, 0.01, 0.09),
        length(stream, 0.06, 0.24),
    );
    let side = |bit: usize, corner: usize| if corner >> bit & 1 == 1 { 0.5 } else { -0.5 };
    let corners = (0..8).map(|corner| Vec3::new(side(0, corner), side(1, corner), side(2, corner)) * size);
    let triangles = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    TriangleMesh::new(corners.collect(), triangles.to_vec()).expect("a box is a mesh")
}

/// From a pen to a bottle, with a waved outline.
fn rod(stream: &mut AttemptStream) -> TriangleMesh {
    let height = length(stream, 0.06, 0.25);
    let radius = length(stream, 0.003, 0.045);
    let (waves, phase, swing) = (
        stream.between(2.0, 9.0),
        stream.between(0.0, TAU),
        stream.between(0.0, 0.5),
    );
    let rings: Vec<Ring> = shares()
        .map(|share| {
            let wave = 1.0 + swing * (waves * share + phase).sin();
            let rounding = 1.0 - 0.5 * (2.0 * share - 1.0).powi(6);
            (radius * wave * rounding, (share - 0.5) * height)
        })
        .collect();
    round(&rings, 1.0)
}

/// A cup or glass that widens or narrows, some with a foot and a stem.
fn cup(stream: &mut AttemptStream) -> TriangleMesh {
    let height = length(stream, 0.05, 0.15);
    let radius = length(stream, 0.02, 0.05);
    let taper = stream.between(0.6, 1.2);
    let wall = stream.between(0.0015, 0.004);
    let mut rings: Vec<Ring> = Vec::new();
    let is_stemmed = stream.unit() < STEMMED;
    if is_stemmed {
        let stem = stream.between(0.04, 0.1);
        rings.extend([
            (0.9 * radius, -stem),
            (0.9 * radius, 0.003 - stem),
            (0.005, 0.006 - stem),
            (0.004, -0.01),
        ]);
    }
    let wide = |share: f32| radius * (taper + (1.0 - taper) * share);
    // The bowl of a glass starts narrow.
    let bottom = if is_stemmed { 0.6 } else { 1.0 };
    rings.push((bottom * wide(0.0), 0.0));
    rings.extend(shares().skip(1).map(|share| (wide(share), share * height)));
    rings.extend(
        shares()
            .skip(1)
            .map(|share| 1.0 - share)
            .take(RINGS - 1)
            .map(|share| (wide(share) - wall, share * height)),
    );
    rings.push((bottom * wide(0.0) - wall, wall));
    round(&rings, 1.0)
}

/// A superellipsoid, more or less flattened and pear-shaped.
fn egg(stream: &mut AttemptStream) -> TriangleMesh {
    let height = length(stream, 0.05, 0.22);
    let radius = length(stream, 0.01, 0.05);
    let (flatness, power, slope) = (
        stream.between(0.12, 1.0),
        stream.between(2.0, 8.0),
        stream.between(-0.5, 0.5),
    );
    let rings: Vec<Ring> = shares()
        .map(|share| {
            let along = 2.0 * share - 1.0;
            let bulge = (1.0 - along.abs().powf(power)).max(0.02).powf(power.recip());
            (radius * (1.0 + slope * along) * bulge, 0.5 * along * height)
        })
        .collect();
    round(&rings, flatness)
}

/// Evenly spaced shares from 0 to 1.
fn shares() -> impl Iterator<Item = f32> {
    (0..=RINGS).map(|ring| ring as f32 / RINGS as f32)
}

/// The body of revolution about z with these rings from bottom to top, squeezed along x and closed by discs.
fn round(rings: &[Ring], flatness: f32) -> TriangleMesh {
    let mut positions: Vec<Vec3> = rings
        .iter()
        .flat_map(|&(radius, height)| {
            (0..CORNERS).map(move |corner| {
                let (sin, cos) = (corner as f32 / CORNERS as f32 * TAU).sin_cos();
                Vec3::new(flatness * radius * cos, radius * sin, height)
            })
        })
        .collect();
    let corner = |ring: usize, corner: usize| (ring * CORNERS + corner % CORNERS) as u32;
    let last = rings.len() - 1;
    let ends = [0, last].map(|ring| {
        positions.push(Vec3::Z * rings[ring].1);
        positions.len() as u32 - 1
    });
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for i in 0..CORNERS {
        for ring in 0..last {
            let [a, b, c, d] = [
                corner(ring, i),
                corner(ring, i + 1),
                corner(ring + 1, i),
                corner(ring + 1, i + 1),
            ];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
        triangles.push([ends[0], corner(0, i + 1), corner(0, i)]);
        triangles.push([ends[1], corner(last, i), corner(last, i + 1)]);
    }
    TriangleMesh::without_degenerates(positions, &triangles).expect("a round body is a mesh")
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    #[test]
    fn shapes_are_closed_and_face_outward() {
        for number in 0..80 {
            let object = draw(number);
            let mesh = object.surface.mesh();
            let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
            for &[a, b, c] in mesh.triangles() {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    let turn = if from < to { 1 } else { -1 };
                    *edges.entry((from.min(to), from.max(to))).or_default() += turn;
                }
            }
            assert!(edges.values().all(|&turns| turns == 0), "{number} is open");
            assert!(mesh.signed_volume() > 0.0, "{number} is inside out");
            assert!(object.bounding_box.half_extents.max_element() < 0.15, "{number}");
        }
    }
}
