//! Meshes as PLY, in text and binary.

#![no_main]

use grasp_characters::ring::Ring;
use grasp_fuzz::{
    DENSE_BYTES, LONGEST, TRIANGLES, Target, bounded_as_all, dense, dense_within, fuzz, grid, read_mesh,
    words,
};

/// Elements that are skipped, lists of other things, triangle strips and every type of number.
const ODD: &[u8] = b"ply\nformat ascii 1.0\nobj_info a\nelement camera 1\nproperty list uchar float view\nelement vertex 4
property double x\nproperty float32 y\nproperty int16 z\nproperty list uint8 int8 extra\nelement face 2
property uint quality\nproperty list ushort uint vertex_index\nelement tristrips 1\nproperty list int int vertex_indices
end_header\n2 0 0\n0 0 0 1 7\n1 0 0 0\n0 1 0 0\n0 0 1 2 3 4\n9 3 0 1 2\n9 4 0 1 2 3\n5 0 1 2 -1 3\n";

/// Binary faces of a byte per number.
fn binary(corners: &[u8]) -> Vec<u8> {
    let faces = (DENSE_BYTES / corners.len()).min(TRIANGLES / (corners.len() - 3));
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty char x\nproperty char y\nproperty char z\n\
         element face {faces}\nproperty list uchar uchar vertex_indices\nend_header\n"
    );
    let vertices = "\0\0\0\x01\0\0\0\x01\0\0\0\x01";
    dense_within(&(header + vertices), corners, faces)
}

fuzz!(Target {
    read: read_mesh,
    seeds: || {
        let ring = Ring::at([0.0; 3], 3);
        let formats = ["ascii", "binary_little_endian", "binary_big_endian"];
        let mut seeds: Vec<_> = formats.iter().map(|format| ring.ply(format)).collect();
        seeds.push(ODD.to_vec());
        seeds
    },
    dense: || {
        let mut dense = bounded_as_all([
            grid().ply("ascii"),
            grid().ply("binary_little_endian"),
            dense("ply\nformat ascii 1.0\n", b"element a 0\n"),
            dense("ply\nformat ascii 1.0\nelement a 0\n", b"property char x\n"),
        ]);
        dense.push((8, binary(&[3, 0, 1, 2])));
        dense.push((12, binary(&[4, 0, 1, 2, 3])));
        dense.push((20, binary(&[7, 0, 1, 2, 0, 1, 2, 3])));
        dense
    },
    longest: LONGEST,
    words: || words(
        "ply format ascii binary_little_endian binary_big_endian 1.0 comment obj_info element vertex face tristrips property list \
         char uchar short ushort int uint float double int8 uint8 int16 uint16 int32 uint32 float32 float64 x y z vertex_indices \
         vertex_index end_header"
    ),
});
