//! Meshes as OBJ text.

#![no_main]

use grasp_characters::ring::Ring;
use grasp_fuzz::{
    LONGEST, TRIANGLES, Target, bounded_as_all, dense, dense_within, fuzz, grid, read_mesh, words,
};

/// Every kind of statement, and odd forms of them.
const STATEMENTS: &[u8] = b"# A comment \\\nmtllib a.mtl\no body\ng a b\nusemtl steel\ns 1
v 0 0 0\nv 1 0 0 1\nv 1. 1e0 -0 .5 .5 .5\nv 0 1 0\nvt 0 0\nvn 0 0 1
f 1/1/1 2/1/1 3//1 4\nf -4 -3 \\\n-2\nl 1 2\np 1\ng\nf 1 2 3 4 2 1
v 0 0 1\nf 4 3 2 1 5\nf 1 5 2\n";

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";

fuzz!(Target {
    read: read_mesh,
    seeds: || {
        let ring = Ring::at([0.0; 3], 4);
        let utf_16 = STATEMENTS.iter().flat_map(|&byte| [byte, 0]).collect();
        vec![
            ring.obj(false),
            Ring::at([20.0; 3], 3).obj(true),
            STATEMENTS.to_vec(),
            utf_16,
        ]
    },
    dense: || {
        let mut dense = bounded_as_all([
            grid().obj(false),
            grid().obj(true),
            dense(CORNERS, b"f 1 2 3\n"),
            dense(CORNERS, b"g a\nf 1 2 3\nf 4 3 2\n"),
            dense("", b"v 1 2 3\n"),
            dense("", b"f 1 2 3\n"),
            dense("", b"?\n"),
        ]);
        let polygon = dense_within(&format!("{CORNERS}f 4"), b" 1 2 3", TRIANGLES / 3);
        dense.push((28, polygon));
        dense.push((7, dense_within(CORNERS, b"f 1 2 3 4\n", TRIANGLES / 2)));
        dense
    },
    longest: LONGEST,
    words: || words("v f g o s l p vn vt vp mtllib usemtl off nan inf 1e39 -1 // 1/1/1 0.5 1e-30 4294967295"),
});
