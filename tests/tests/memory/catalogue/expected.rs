//! What is expected of each file: the start of each warning of a mesh, or of each error.

/// What becomes of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Expected {
    /// A mesh with these warnings.
    Mesh(&'static [&'static str]),
    /// These errors.
    Errors(&'static [&'static str]),
}
use Expected::{Errors, Mesh};

/// The files, by their paths in the test data.
pub(crate) const FILES: &[(&str, Expected)] = &[
    ("objects/osim_banana.obj", Mesh(&[])),
    ("objects/osim_hammer.obj", Mesh(&[])),
    ("objects/osim_knife.obj", Mesh(&[])),
    ("objects/osim_mug.obj", Mesh(&[])),
    (
        "objects/osim_phone.obj",
        Mesh(&[
            "4 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 3131",
        ]),
    ),
    ("objects/osim_scissors.obj", Mesh(&[])),
    ("objects/osim_toothbrush.obj", Mesh(&[])),
    ("objects/osim_wineglass.obj", Mesh(&[])),
    ("objects/xr_google-daydream.obj", Mesh(&[])),
    (
        "objects/xr_logitech-mx-ink.obj",
        Mesh(&[
            "251 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 1949",
            "2 edges join more than two triangles; the first is at the face on line 4665",
            "7 parts are disconnected: they share no vertex",
        ]),
    ),
    (
        "objects/xr_oculus-go.obj",
        Mesh(&[
            "72 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 2151",
            "32 edges join more than two triangles; the first is at the face on line 2413",
            "2 parts are disconnected: they share no vertex",
        ]),
    ),
    ("reports/concave-ngon/t2-l-profile.obj", Mesh(&[])),
    ("reports/hook-carry/t2-lunchbox.obj", Mesh(&[])),
    (
        "reports/instanced/instanced.glb",
        Mesh(&["3 parts are disconnected: they share no vertex"]),
    ),
    ("reports/long-and-wide/t2-stick-cross.obj", Mesh(&[])),
    ("reports/long-and-wide/t2-stick.obj", Mesh(&[])),
    ("reports/metacarpal-numbers/arp.glb", Mesh(&[])),
    ("reports/metacarpal-numbers/four-and-end.glb", Mesh(&[])),
    (
        "reports/newcomer-cli-up-axis/knife.glb",
        Mesh(&["2 parts are disconnected: they share no vertex"]),
    ),
    ("reports/newcomer-fat-fingers/hand_l.gltf", Mesh(&[])),
    ("reports/newcomer-fat-fingers/hand_r.gltf", Mesh(&[])),
    (
        "reports/newcomer-preferred-region/mug.glb",
        Mesh(&["3 parts are disconnected: they share no vertex"]),
    ),
    (
        "reports/newcomer-preferred-scale/knife.glb",
        Mesh(&["2 parts are disconnected: they share no vertex"]),
    ),
    ("reports/not-utf8/t2-utf16be.obj", Mesh(&[])),
    ("reports/not-utf8/t2-utf16le.obj", Mesh(&[])),
    ("reports/ply-odd/a-cr.ply", Mesh(&[])),
    ("reports/ply-odd/blank-lines-in-body.ply", Mesh(&[])),
    ("reports/ply-odd/comment-in-body.ply", Mesh(&[])),
    (
        "reports/ply-odd/float-index.ply",
        Errors(&["the PLY header: has a list vertex_indices of fractions"]),
    ),
    (
        "reports/ply-odd/nan.ply",
        Errors(&["line 10: \"nan\" is not finite"]),
    ),
    (
        "reports/seven-value-vertex/t2-seven.obj",
        Mesh(&[
            "8 vertices have seven numbers, read as x y z and a colour with alpha, not as x y z and a weight and a colour; the first is on line 1",
        ]),
    ),
    ("reports/two-handed-giver/t2-book2.obj", Mesh(&[])),
    ("reports/zero-thickness/t2-card-box.obj", Mesh(&[])),
    (
        "reports/zero-thickness/t2-card-plane.obj",
        Mesh(&[
            "4 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 5",
        ]),
    ),
    (
        "reports/zero-thickness/t2-card-two-sided.obj",
        Mesh(&[
            "2 triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was kept; the first is on line 6",
            "4 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 5",
        ]),
    ),
    (
        "ugly/sh3d_headphones_raw.obj",
        Mesh(&[
            "2 triangles that repeat an earlier one with the opposite winding were kept: the rest of the surface is closed without either; the first is on line 5142",
            "4 triangles faced the opposite way of the rest of their part and were turned; the first is on line 4022",
            "36 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 3845",
            "12 edges join more than two triangles; the first is at the face on line 4021",
            "6 parts are disconnected: they share no vertex",
        ]),
    ),
    ("ugly/sh3d_old_jar_raw.obj", Mesh(&[])),
    ("ugly/tinyobj_cube-vertexcol.obj", Mesh(&[])),
    (
        "ugly/tinyobj_invalid-face-definition.obj",
        Errors(&[
            "the mesh has no triangles; 2 points, lines and faces without area and 0 lines with an unknown keyword were ignored",
        ]),
    ),
    (
        "ugly/tinyobj_invalid-relative-vertex-index.obj",
        Errors(&[
            "line 1: vertex -4 does not exist; 0 are known, counted from 1 or backward from -1",
            "line 1: vertex -3 does not exist; 0 are known, counted from 1 or backward from -1",
            "line 1: vertex -2 does not exist; 0 are known, counted from 1 or backward from -1",
        ]),
    ),
    (
        "ugly/tinyobj_issue-140-zero-face-idx.obj",
        Errors(&["line 16: vertex 0 does not exist; 4 are known, counted from 1 or backward from -1"]),
    ),
    (
        "ugly/tinyobj_leading-decimal-dot-issue-201.obj",
        Mesh(&[
            "the mesh is 34.504 m from the file's origin: the object's origin is the centre of the mesh's box, about (",
            "3 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 7",
        ]),
    ),
    (
        "ugly/tinyobj_line-prim.obj",
        Errors(&[
            "the mesh has no triangles; 2 points, lines and faces without area and 0 lines with an unknown keyword were ignored",
        ]),
    ),
    (
        "ugly/tinyobj_missing_material_file.obj",
        Mesh(&[
            "the mesh is 480.370 m from the file's origin: the object's origin is the centre of the mesh's box, about (",
            "4 vertices are not used by any face",
            "8 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 27",
            "4 parts are disconnected: they share no vertex",
        ]),
    ),
    (
        "ugly/tinyobj_no_material.obj",
        Mesh(&[
            "the mesh is 480.370 m from the file's origin: the object's origin is the centre of the mesh's box, about (",
            "4 vertices are not used by any face",
            "8 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 24",
            "4 parts are disconnected: they share no vertex",
        ]),
    ),
    (
        "ugly/tinyobj_points-prim.obj",
        Errors(&[
            "the mesh has no triangles; 1 points, lines and faces without area and 0 lines with an unknown keyword were ignored",
        ]),
    ),
    (
        "ugly/tinyobj_test-nan.obj",
        Errors(&[
            "line 12: \"nan\" is not finite or makes the vertex infinite",
            "line 13: \"inf\" is not finite or makes the vertex infinite",
            "line 14: \"1.#IND\" is not a number",
            "line 15: \"1.#INF\" is not a number",
        ]),
    ),
    (
        "ugly/trimesh_chair_model.obj",
        Mesh(&[
            "8 triangles that repeat an earlier one were dropped; the first is on line 12890",
            "6374 triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was kept; the first is on line 9317",
            "1740 triangles faced the opposite way of the rest of their part and were turned; the first is on line 12892",
            "10 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 12908",
            "51 edges join more than two triangles; the first is at the face on line 12888",
            "3 parts are disconnected: they share no vertex",
        ]),
    ),
    (
        "ugly/trimesh_cycloidal.ply",
        Mesh(&[
            "242 edges join more than two triangles; the first is at face 627",
            "100 parts are disconnected: they share no vertex",
        ]),
    ),
    (
        "ugly/trimesh_empty.obj",
        Errors(&[
            "the file is empty or has only blank lines and comments; a mesh is required as GLB, glTF, OBJ, PLY or STL",
        ]),
    ),
    (
        "ugly/trimesh_multibody.stl",
        Mesh(&[
            "26 triangles faced the opposite way of the rest of their part and were turned; the first is on line 2",
            "2 parts are disconnected: they share no vertex",
        ]),
    ),
    ("ugly/trimesh_nancolor.obj", Mesh(&[])),
    ("ugly/trimesh_negative_indices.obj", Mesh(&[])),
    (
        "ugly/trimesh_polygonfaces.obj",
        Mesh(&[
            "the mesh is 250.000 m from the file's origin: the object's origin is the centre of the mesh's box, about (",
            "5 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 11",
        ]),
    ),
    (
        "ugly/trimesh_quadknot.obj",
        Mesh(&[
            "the mesh is 99.743 m from the file's origin: the object's origin is the centre of the mesh's box, about (",
        ]),
    ),
    (
        "ugly/trimesh_soup.stl",
        Mesh(&[
            "300 edges are open: the surface has holes and its volume is an estimate; the first is at triangle 0",
            "100 parts are disconnected: they share no vertex",
        ]),
    ),
    (
        "ugly/trimesh_wallhole.obj",
        Mesh(&[
            "the mesh is 10.308 m from the file's origin: the object's origin is the centre of the mesh's box, about (",
            "9 triangles without area were dropped; the first is on line 286",
            "1 triangles that repeat an earlier one with the opposite winding were kept: the rest of the surface is closed without either; the first is on line 288",
            "1 edges join more than two triangles; the first is at the face on line 287",
        ]),
    ),
];
