//! Models whose hands are drawn by several skins.

use super::{assert_alike, named, opened, read};
use glam::{Mat4, Quat, Vec3};
use grasp_characters::{Character, Style, names::mixamo};
use serde_json::{Value, json};

/// Floats of an accessor.
fn floats(document: &Value, buffer: &[u8], accessor: usize) -> Vec<f32> {
    let view = document["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
    let view = &document["bufferViews"][view];
    let [start, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
    let (floats, _) = buffer[start..start + length].as_chunks::<4>();
    floats.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

/// Adds floats with the type of another accessor, and returns their accessor.
fn added(document: &mut Value, buffer: &mut Vec<u8>, like: usize, floats: &[f32]) -> Value {
    let (start, length) = (buffer.len(), 4 * floats.len());
    buffer.extend(floats.iter().flat_map(|float| float.to_le_bytes()));
    let views = document["bufferViews"].as_array_mut().unwrap();
    views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length }));
    let view = views.len() - 1;
    document["buffers"][0]["byteLength"] = json!(buffer.len());
    let mut accessor = document["accessors"][like].clone();
    accessor["bufferView"] = json!(view);
    let accessors = document["accessors"].as_array_mut().unwrap();
    accessors.push(accessor);
    json!(accessors.len() - 1)
}

/// The model with its thumbs in a skin of their own, bound elsewhere and in other units.
fn in_two_skins(glb: &[u8]) -> Vec<u8> {
    let (mut document, mut buffer) = opened(glb);
    let elsewhere = Mat4::from_scale_rotation_translation(
        Vec3::splat(40.0),
        Quat::from_rotation_x(1.1),
        Vec3::new(3.0, -2.0, 7.0),
    );
    let [positions, weights, binds] = [0, 2, 4].map(|accessor| floats(&document, &buffer, accessor));
    let joints_at = document["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    let is_of_thumb = |vertex: usize| {
        let weight = |place: &usize| weights[4 * vertex + place];
        let heaviest = (0..4).max_by(|a, b| weight(a).total_cmp(&weight(b))).unwrap();
        let joint = u16::from_le_bytes(
            *buffer[joints_at + 8 * vertex + 2 * heaviest..]
                .first_chunk()
                .unwrap(),
        );
        let name = &document["nodes"][usize::from(joint)]["name"];
        name.as_str().unwrap().contains("Thumb")
    };
    let [rest, thumbs] = [false, true].map(|of_thumbs| -> Vec<f32> {
        let weights = weights.iter().enumerate();
        let kept = weights.map(|(place, weight)| f32::from(is_of_thumb(place / 4) == of_thumbs) * weight);
        kept.collect()
    });
    assert!(thumbs.iter().any(|&weight| weight > 0.0));
    let positions = positions.chunks(3).map(Vec3::from_slice);
    let moved: Vec<f32> = positions
        .flat_map(|position| elsewhere.transform_point3(position).to_array())
        .collect();
    let binds = binds.chunks(16).map(Mat4::from_cols_slice);
    let binds: Vec<f32> = binds
        .flat_map(|bind| (bind * elsewhere.inverse()).to_cols_array())
        .collect();
    let mut mesh = document["meshes"][0].clone();
    document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] =
        added(&mut document, &mut buffer, 2, &rest);
    mesh["primitives"][0]["attributes"]["WEIGHTS_0"] = added(&mut document, &mut buffer, 2, &thumbs);
    mesh["primitives"][0]["attributes"]["POSITION"] = added(&mut document, &mut buffer, 0, &moved);
    let mut skin = document["skins"][0].clone();
    skin["inverseBindMatrices"] = added(&mut document, &mut buffer, 4, &binds);
    document["meshes"].as_array_mut().unwrap().push(mesh);
    // First in the file, though it moves fewer vertices.
    document["skins"].as_array_mut().unwrap().insert(0, skin);
    let nodes = document["nodes"].as_array_mut().unwrap();
    nodes.last_mut().unwrap()["skin"] = json!(1);
    nodes.push(json!({ "name": "Thumbs", "mesh": 1, "skin": 0 }));
    let last = json!(nodes.len() - 1);
    let roots = document["scenes"][0]["nodes"].as_array_mut().unwrap();
    roots.push(last);
    grasp_characters::glb(&document, buffer)
}

#[test]
fn each_skin_is_bound_by_its_own_matrices() {
    let style = Style {
        units_per_metre: 100.0,
        ..named(mixamo)
    };
    let glb = Character::new(&style).glb;
    let [whole, split] = [glb.clone(), in_two_skins(&glb)].map(|glb| read(&glb).unwrap());
    for (own, expected) in [(&split.left, &whole.left), (&split.right, &whole.right)] {
        assert_alike(&own.rig, &expected.rig, [1e-4, 1e-3, 1e-2], "split");
    }
}
