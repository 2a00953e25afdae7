//! Turns an implicit surface into a closed triangle mesh: marching tetrahedra over a regular grid, each cube split
//! into six tetrahedra around one diagonal (Kuhn's subdivision), so that the mesh is always closed and manifold.

use std::collections::BTreeMap;

use glam::{UVec3, Vec3};

/// Vertices and triangles, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub(super) struct RawMesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// The six tetrahedra of a cube whose corners are numbered by the bits x, y, z.
const TETRAHEDRA: [[usize; 4]; 6] = [
    [0, 1, 3, 7],
    [0, 3, 2, 7],
    [0, 2, 6, 7],
    [0, 6, 4, 7],
    [0, 4, 5, 7],
    [0, 5, 1, 7],
];

/// The zero surface of `value` (negative inside) in the box from `min` to `max`, on a grid of `step` metres.
pub(super) fn polygonise(value: impl Fn(Vec3) -> f32, min: Vec3, max: Vec3, step: f32) -> RawMesh {
    let cells = ((max - min) / step).ceil().as_uvec3();
    let points = cells + UVec3::ONE;
    let index = |p: UVec3| p.x + points.x * (p.y + points.y * p.z);
    let position = |i: u32| {
        let p = UVec3::new(i % points.x, i / points.x % points.y, i / (points.x * points.y));
        min + step * p.as_vec3()
    };
    let values: Vec<f32> = (0..points.element_product())
        .map(|i| value(position(i)))
        .collect();
    let mut mesh = RawMesh::default();
    let mut crossings = BTreeMap::new();
    for z in 0..cells.z {
        for y in 0..cells.y {
            for x in 0..cells.x {
                let corner: [u32; 8] = std::array::from_fn(|c| {
                    let c = c as u32;
                    index(UVec3::new(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)))
                });
                for tetrahedron in TETRAHEDRA {
                    let corners = tetrahedron.map(|c| corner[c]);
                    let (inside, outside): (Vec<u32>, Vec<u32>) =
                        corners.iter().partition(|&&c| values[c as usize] < 0.0);
                    if inside.is_empty() || outside.is_empty() {
                        continue;
                    }
                    let mut crossing = |a: u32, b: u32| {
                        let (a, b) = (a.min(b), a.max(b));
                        *crossings.entry((a, b)).or_insert_with(|| {
                            let (u, v) = (values[a as usize], values[b as usize]);
                            // Kept off the corners, so that no triangle collapses.
                            let t = (u / (u - v)).clamp(0.02, 0.98);
                            mesh.positions.push(position(a).lerp(position(b), t));
                            mesh.positions.len() as u32 - 1
                        })
                    };
                    // One corner against three gives a triangle, two against two give a quadrilateral.
                    let ring: Vec<u32> = match (inside.as_slice(), outside.as_slice()) {
                        ([a], [b, c, d]) | ([b, c, d], [a]) => {
                            vec![crossing(*a, *b), crossing(*a, *c), crossing(*a, *d)]
                        }
                        ([a, b], [c, d]) => {
                            vec![
                                crossing(*a, *c),
                                crossing(*a, *d),
                                crossing(*b, *d),
                                crossing(*b, *c),
                            ]
                        }
                        _ => unreachable!("four corners are split one to three or two to two"),
                    };
                    let out = position(outside[0]) - position(inside[0]);
                    for i in 1..ring.len() - 1 {
                        let triangle = [ring[0], ring[i], ring[i + 1]];
                        let [p, q, r] = triangle.map(|v| mesh.positions[v as usize]);
                        let outward = (q - p).cross(r - p).dot(out) > 0.0;
                        mesh.triangles.push(if outward {
                            triangle
                        } else {
                            [triangle[0], triangle[2], triangle[1]]
                        });
                    }
                }
            }
        }
    }
    mesh
}
