//! Meshes as STL, in text and binary.

#![no_main]

use grasp_characters::ring::Ring;
use grasp_fuzz::{DENSE_BYTES, LONGEST, Target, bounded_as_all, dense, fuzz, grid, read_mesh, words};

/// Two solids, the second in odd letters and without triangles.
const SOLIDS: &[u8] =
    b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 -.5\nendloop
endfacet\nendsolid a\nSOLID b\nendsolid\n";

const FACET: &[u8] = b"facet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";

/// Binary, of triangles at places of their own.
fn binary() -> Vec<u8> {
    let triangles = DENSE_BYTES / 50;
    let mut bytes = vec![0; 80];
    bytes.extend((triangles as u32).to_le_bytes());
    for triangle in 0..triangles {
        for place in 0..12 {
            let number = (triangle * 12 + place * place) as f32;
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fuzz!(Target {
    read: read_mesh,
    seeds: || {
        let ring = Ring::at([0.0; 3], 3);
        vec![ring.stl_text(), ring.stl_binary(), SOLIDS.to_vec()]
    },
    dense: || bounded_as_all([
        grid().stl_text(),
        grid().stl_binary(),
        dense("solid\n", FACET),
        dense("solid\n", b"facet\nendfacet\n"),
        binary()
    ]),
    longest: LONGEST,
    words: || words("solid facet normal outer loop vertex endloop endfacet endsolid nan inf 1e39 -1 0.5"),
});
