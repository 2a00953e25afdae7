//! Several skins, each with its own bind matrices.

use glam::{Mat4, Vec3};
use grasp_characters::{Character, Style, names::mixamo};
use serde_json::{Value, json};

use crate::tests::rigs::{differences, edited, read};

/// A block of floats of a GLB.
fn floats(document: &Value, buffer: &[u8], accessor: usize) -> Vec<f32> {
    let view =
        &document["bufferViews"][document["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize];
    let [start, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
    buffer[start..start + length]
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect()
}

/// Adds a block of floats with the type of another accessor, and gives its accessor.
fn added(document: &mut Value, buffer: &mut Vec<u8>, like: usize, numbers: &[f32]) -> usize {
    let view = document["bufferViews"].as_array().unwrap().len();
    let start = buffer.len();
    buffer.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    let length = buffer.len() - start;
    document["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length }));
    document["buffers"][0]["byteLength"] = json!(buffer.len());
    let mut accessor = document["accessors"][like].clone();
    accessor["bufferView"] = json!(view);
    let accessors = document["accessors"].as_array_mut().unwrap();
    accessors.push(accessor);
    accessors.len() - 1
}

/// The character in two skins: the first one is of all that does not follow thumbs, the second, which is bound elsewhere and in
/// other units, of thumbs.
fn in_two_skins(glb: &[u8]) -> Vec<u8> {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut document: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let mut buffer = glb[28 + length..].to_vec();
    let elsewhere = Mat4::from_scale_rotation_translation(
        Vec3::splat(40.0),
        glam::Quat::from_rotation_x(1.1),
        Vec3::new(3.0, -2.0, 7.0),
    );
    let positions = floats(&document, &buffer, 0);
    let weights = floats(&document, &buffer, 2);
    let binds = floats(&document, &buffer, 4);
    let joints_at = document["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    let is_thumb = |joint: usize| {
        document["nodes"][joint]["name"]
            .as_str()
            .unwrap()
            .contains("Thumb")
    };
    let most = |vertex: usize| {
        let place = (0..4)
            .max_by(|&a, &b| weights[4 * vertex + a].total_cmp(&weights[4 * vertex + b]))
            .unwrap();
        let at = joints_at + 8 * vertex + 2 * place;
        usize::from(u16::from_le_bytes([buffer[at], buffer[at + 1]]))
    };
    let of_thumbs: Vec<bool> = (0..weights.len() / 4)
        .map(|vertex| is_thumb(most(vertex)))
        .collect();
    assert!(of_thumbs.contains(&true));
    let kept = |thumbs: bool| -> Vec<f32> {
        let kept = weights.iter().enumerate();
        kept.map(|(place, &weight)| {
            if of_thumbs[place / 4] == thumbs {
                weight
            } else {
                0.0
            }
        })
        .collect()
    };
    let moved: Vec<f32> = positions
        .chunks(3)
        .flat_map(|position| elsewhere.transform_point3(Vec3::from_slice(position)).to_array())
        .collect();
    let moved_binds: Vec<f32> = binds
        .chunks(16)
        .flat_map(|bind| (Mat4::from_cols_slice(bind) * elsewhere.inverse()).to_cols_array())
        .collect();
    let [rest, thumbs] = [kept(false), kept(true)];
    let rest = added(&mut document, &mut buffer, 2, &rest);
    let thumbs = added(&mut document, &mut buffer, 2, &thumbs);
    let moved = added(&mut document, &mut buffer, 0, &moved);
    let binds = added(&mut document, &mut buffer, 4, &moved_binds);
    document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(rest);
    let mut mesh = document["meshes"][0].clone();
    mesh["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(thumbs);
    mesh["primitives"][0]["attributes"]["POSITION"] = json!(moved);
    document["meshes"].as_array_mut().unwrap().push(mesh);
    // The one of the thumbs comes first in the file, though it moves fewer vertices.
    let mut skin = document["skins"][0].clone();
    skin["inverseBindMatrices"] = json!(binds);
    document["skins"].as_array_mut().unwrap().insert(0, skin);
    let nodes = document["nodes"].as_array_mut().unwrap();
    nodes.last_mut().unwrap()["skin"] = json!(1);
    nodes.push(json!({ "name": "Thumbs", "mesh": 1, "skin": 0 }));
    let last = nodes.len() - 1;
    document["scenes"][0]["nodes"]
        .as_array_mut()
        .unwrap()
        .push(json!(last));
    grasp_characters::glb(&document, buffer)
}

#[test]
fn each_skin_is_bound_by_its_own_matrices() {
    let glb = Character::new(&Style {
        name: mixamo,
        units_per_metre: 100.0,
        ..Style::PLAIN
    })
    .glb;
    let whole = read(&glb).unwrap();
    let split = read(&in_two_skins(&glb)).unwrap();
    for (own, expected) in [
        (&split.left.rig, &whole.left.rig),
        (&split.right.rig, &whole.right.rig),
    ] {
        let [places, directions, radii] = differences(own, expected);
        assert!(places.0 < 1e-4, "{places:?}");
        assert!(directions.0 < 1e-3, "{directions:?}");
        assert!(radii.0 < 1e-2, "{radii:?}");
    }
}

#[test]
fn a_skin_that_nothing_shows_binds_nothing() {
    let glb = Character::new(&Style {
        name: mixamo,
        ..Style::PLAIN
    })
    .glb;
    let whole = read(&glb).unwrap();
    let odd = edited(&glb, |document| {
        let mut skin = document["skins"][0].clone();
        // All bones at the mesh's origin.
        skin.as_object_mut().unwrap().remove("inverseBindMatrices");
        document["skins"].as_array_mut().unwrap().insert(0, skin);
        document["nodes"].as_array_mut().unwrap().last_mut().unwrap()["skin"] = json!(1);
    });
    assert_eq!(read(&odd).unwrap().right.rig, whole.right.rig);
}
