//! Writes characters with the built-in hands, as programs with their own names, units and axes would.

mod fingers;
pub mod names;
pub mod ring;

use glam::{Mat4, Quat, Vec3};
use gltf::binary::{Glb, Header};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Digit, Handedness,
        joints::{JOINT_COUNT, index},
    },
};
use serde_json::{Value, json};

use fingers::Shape;
use names::side_name;

/// How a program writes characters.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// The name of a joint's node; `None` for joints that it does not have.
    pub name: fn(Handedness, usize) -> Option<String>,
    /// Units of the file per metre; the armature's scale makes metres of them.
    pub units_per_metre: f32,
    /// Which hands it shows.
    pub sides: &'static [Handedness],
    /// Metres per metre of the built-in hand.
    pub size: f32,
    /// True for nodes that are all next to one another.
    pub is_flat: bool,
    /// The fingers of its hands, in order. Fewer than four are spread over the palm and are thicker.
    pub fingers: &'static [Digit],
    /// How much thicker the digits of four fingers are than the adult's.
    pub thickness: f32,
    /// By how much each joint of four fingers is bent where the skin is bound, in radians.
    pub bend: f32,
    /// The document's extensions, from the names of the nodes.
    pub extensions: fn(&[String]) -> Value,
}

impl Style {
    /// Both hands in metres, in a tree.
    pub const PLAIN: Self = Self {
        name: names::webxr,
        units_per_metre: 1.0,
        sides: &[Handedness::Left, Handedness::Right],
        size: 1.0,
        is_flat: false,
        fingers: &[Digit::Index, Digit::Middle, Digit::Ring, Digit::Little],
        thickness: 1.0,
        bend: 0.0,
        extensions: |_| json!({}),
    };
}

/// A character.
#[derive(Clone, Debug)]
pub struct Character {
    /// The file.
    pub glb: Vec<u8>,
}

struct Node {
    name: String,
    parent: Option<usize>,
    /// In metres, in the frame of the character.
    pose: Pose,
}

/// The wrist of a hand that is stretched to the side, in `OpenXR` axes.
pub fn character_from_wrist(side: Handedness) -> Pose {
    let right = Pose::new(
        Vec3::new(-0.68, 1.38, 0.04),
        Quat::from_rotation_z(0.2) * Quat::from_rotation_y(std::f32::consts::FRAC_PI_2),
    );
    match side {
        Handedness::Left => right.mirrored_x(),
        Handedness::Right => right,
    }
}

/// The nearest ancestor of a joint that the style has.
fn parent_of(joint: usize, has: impl Fn(usize) -> bool) -> usize {
    let parent = if index::FIRST_OF_DIGIT.contains(&joint) {
        index::WRIST
    } else {
        joint - 1
    };
    if has(parent) {
        parent
    } else {
        parent_of(parent, has)
    }
}

/// Axes of a node that have nothing to do with the bone's.
fn odd_axes(joint: usize) -> Quat {
    let angle = joint as f32;
    Quat::from_rotation_x(angle) * Quat::from_rotation_y(0.7 * angle) * Quat::from_rotation_z(-1.3 * angle)
}

impl Character {
    /// Writes a character whose hands are the adult's but for their size and fingers, bound and standing in the bind pose.
    pub fn new(style: &Style) -> Self {
        let node = |name: &str, parent: Option<usize>, height: f32| Node {
            name: name.to_owned(),
            parent,
            pose: Pose::from_position(height * Vec3::Y),
        };
        let mut nodes = vec![
            node("Armature", None, 0.0),
            node("Hips", Some(0), 1.0),
            node("Head", Some(1), 1.6),
        ];
        let mut body = Body::default();
        // A box.
        for corner in 0..8_u32 {
            let side = |bit: u32| if corner >> bit & 1 == 0 { -0.2 } else { 0.2 };
            body.positions
                .push(Vec3::new(side(0), 1.2 + 2.0 * side(1), 0.5 * side(2)));
            body.joints.push([1, 0, 0, 0]);
            body.weights.push([1.0, 0.0, 0.0, 0.0]);
        }
        body.corners.extend([0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6]);
        for &side in style.sides {
            let Shape {
                skin,
                bind,
                positions: shaped,
            } = Shape::new(side, style);
            let character_from_hand = character_from_wrist(side) * bind.joints[index::WRIST].pose.inverse();
            let place = |pose: Pose| {
                let wrist = bind.joints[index::WRIST].pose.position;
                let scaled = Pose {
                    position: wrist + style.size * (pose.position - wrist),
                    ..pose
                };
                character_from_hand * scaled
            };
            let arm = nodes.len();
            nodes.push(Node {
                name: format!("{}ForeArm", side_name(side)),
                parent: Some(1),
                pose: Pose::from_position(character_from_wrist(side).position * Vec3::new(0.6, 1.0, 1.0)),
            });
            let name = |joint: usize| (style.name)(side, joint).filter(|_| bind.has(joint));
            let has = |joint: usize| name(joint).is_some();
            let mut node_of = [0; JOINT_COUNT];
            for joint in 1..JOINT_COUNT {
                let Some(name) = name(joint) else { continue };
                node_of[joint] = nodes.len();
                let pose = place(bind.joints[joint].pose);
                nodes.push(Node {
                    name,
                    parent: Some(match joint {
                        _ if style.is_flat => arm,
                        index::WRIST => arm,
                        _ => node_of[parent_of(joint, has)],
                    }),
                    pose: Pose::new(pose.position, pose.orientation * odd_axes(joint)),
                });
            }
            let first = body.positions.len() as u32;
            let placed = shaped
                .iter()
                .map(|&position| place(Pose::from_position(position)).position);
            body.positions.extend(placed);
            body.joints.extend(skin.joint_indices.iter().map(|indices| {
                indices.map(|joint| {
                    let joint = usize::from(joint).max(1);
                    let joint = if has(joint) { joint } else { parent_of(joint, has) };
                    node_of[joint] as u16
                })
            }));
            body.weights.extend(&skin.weights);
            let corners = skin.triangles.as_flattened().iter();
            body.corners.extend(corners.map(|corner| first + corner));
        }
        let glb = write(style, &nodes, &body);
        Self { glb }
    }
}

/// The data of a skinned mesh.
#[derive(Default)]
struct Body {
    positions: Vec<Vec3>,
    joints: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
    corners: Vec<u32>,
}

fn write(style: &Style, nodes: &[Node], body: &Body) -> Vec<u8> {
    let units = style.units_per_metre;
    let in_units = |pose: Pose| Pose::new(units * pose.position, pose.orientation);
    let describe = |(place, node): (usize, &Node)| {
        let parent = node.parent.map_or(Pose::IDENTITY, |parent| nodes[parent].pose);
        let local = in_units(parent.inverse() * node.pose);
        let children = (0..nodes.len()).filter(|&child| nodes[child].parent == Some(place));
        let children: Vec<usize> = children.collect();
        let mut described = json!({
            "name": node.name,
            "translation": local.position.to_array(),
            "rotation": local.orientation.to_array(),
        });
        if !children.is_empty() {
            described["children"] = json!(children);
        }
        if place == 0 {
            described["scale"] = json!(Vec3::splat(1.0 / units).to_array());
        }
        described
    };
    let mut described: Vec<Value> = nodes.iter().enumerate().map(describe).collect();
    described.push(json!({ "name": "Body", "mesh": 0, "skin": 0 }));
    let inverse_binds = nodes.iter().map(|node| {
        let Pose {
            position,
            orientation,
        } = in_units(node.pose);
        Mat4::from_rotation_translation(orientation, position)
            .inverse()
            .to_cols_array()
    });
    let floats = |rows: &[f32]| -> Vec<u8> { rows.iter().flat_map(|number| number.to_le_bytes()).collect() };
    let positions: Vec<[f32; 3]> = body.positions.iter().map(|&p| (units * p).to_array()).collect();
    let weights = floats(body.weights.as_flattened());
    let joints = body.joints.as_flattened().iter();
    let joints = joints.flat_map(|joint| joint.to_le_bytes()).collect();
    let corners = body.corners.iter();
    let corners = corners.flat_map(|corner| corner.to_le_bytes()).collect();
    let inverse_binds = floats(inverse_binds.collect::<Vec<_>>().as_flattened());
    let blocks: [(Vec<u8>, u32, &str, usize); 5] = [
        (floats(positions.as_flattened()), 5126, "VEC3", positions.len()),
        (joints, 5123, "VEC4", body.joints.len()),
        (weights, 5126, "VEC4", body.weights.len()),
        (corners, 5125, "SCALAR", body.corners.len()),
        (inverse_binds, 5126, "MAT4", nodes.len()),
    ];
    let mut buffer: Vec<u8> = Vec::new();
    let (mut views, mut accessors) = (Vec::new(), Vec::new());
    for (view, (block, component, kind, count)) in blocks.into_iter().enumerate() {
        views.push(json!({ "buffer": 0, "byteOffset": buffer.len(), "byteLength": block.len() }));
        accessors
            .push(json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }));
        buffer.extend(block);
    }
    accessors[0]["min"] = json!(Vec3::splat(-1e6).to_array());
    accessors[0]["max"] = json!(Vec3::splat(1e6).to_array());
    let names: Vec<String> = nodes.iter().map(|node| node.name.clone()).collect();
    let document = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, described.len() - 1] }],
        "nodes": described,
        "skins": [{ "joints": (0..nodes.len()).collect::<Vec<_>>(), "inverseBindMatrices": 4 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2 }, "indices": 3,
        }] }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{ "byteLength": buffer.len() }],
        "extensions": (style.extensions)(&names),
    });
    glb(&document, buffer)
}

/// The right hand of the `WebXR` input profiles, a model that nobody here made; `None` before `tests/foreign/run` fetches it.
pub fn webxr_hand() -> Option<Vec<u8>> {
    let workspace = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let profiles = workspace.join("target/foreign/node_modules/@webxr-input-profiles/assets/dist/profiles");
    std::fs::read(profiles.join("generic-hand/right.glb")).ok()
}

/// Packs a document and its buffer as GLB.
pub fn glb(document: &Value, buffer: Vec<u8>) -> Vec<u8> {
    let header = Header {
        magic: *b"glTF",
        version: 2,
        length: 0,
    };
    let file = Glb {
        header,
        json: document.to_string().into_bytes().into(),
        bin: Some(buffer.into()),
    };
    file.to_vec().expect("writing to memory cannot fail")
}
