//! Requests with every field of the contract, and some that are right.

use std::{collections::HashMap, time::Duration};

use glam::{Quat, Vec3};
use grasp_assets::hands::hand;
use grasp_proto::{FILE_DESCRIPTOR_SET, json::to_json, v1};
use grasp_server::fuzzing::request_names;
use grasp_synthesis::model::hand::Handedness;
use prost::{Message, Name};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};
use serde_json::{Value, json};

/// Requests in JSON, each with the place of its message's name.
pub fn requests() -> Vec<(usize, Value)> {
    let contract = Contract::new();
    let places = || request_names().enumerate();
    // The first, the second and the third of alternatives.
    let full = (0..3).flat_map(|choice| places().map(move |(place, name)| (place, name, choice)));
    let mut requests: Vec<_> = full
        .map(|(place, name, choice)| (place, contract.full(&format!(".grasp.v1.{name}"), choice)))
        .collect();
    requests.extend(right());
    requests
}

/// The names of fields and of the values of enumerations.
pub fn names() -> Vec<String> {
    let contract = Contract::new();
    let fields = contract.messages.values().flat_map(|message| &message.field);
    let mut names: Vec<String> = fields
        .map(|field| format!("\"{}\":", field.json_name()))
        .collect();
    names.extend(
        contract
            .enums
            .values()
            .flatten()
            .map(|name| format!("\"{name}\"")),
    );
    names.extend(
        [
            "\"objects/mug\"",
            "\"rigs/adult\"",
            "\"NaN\"",
            "\"-Infinity\"",
            "1e-45",
            "null",
        ]
        .map(str::to_owned),
    );
    names.sort();
    names.dedup();
    names
}

/// Requests that the server accepts.
fn right() -> Vec<(usize, Value)> {
    fn of<M: Message + Name>(request: &M) -> (usize, Value) {
        let place = request_names().position(|name| name == M::NAME);
        let json = to_json(request).expect("requests have no odd times");
        (place.expect("it is a request"), json)
    }
    let place = v1::Pose::new(Vec3::new(0.1, 1.2, -0.3), Quat::from_rotation_y(0.3));
    let posed = v1::HandPose::new("rigs/adult", v1::Handedness::Left)
        .with_client_from_wrist(place)
        .with_digits([Some(v1::DigitAngles::default()); 5]);
    let bind = &hand("adult", Handedness::Right)
        .expect("the rig is built in")
        .skin
        .bind;
    let joints = bind.joints.map(|joint| v1::JointPose {
        pose: Some(v1::Pose::new(joint.pose.position, joint.pose.orientation)),
        radius: joint.radius,
    });
    let joints = v1::HandJoints {
        handedness: v1::Handedness::Right.into(),
        joints: joints.to_vec(),
    };
    let find = v1::FindGraspRequest::new("objects/mug")
        .with_client_from_object(place)
        .with_obstacle(v1::Shape::half_space(Vec3::ZERO, Vec3::Y))
        .with_budget(Duration::from_millis(50))
        .with_seed(7);
    let mut holdout = v1::Holdout::new("objects/mug");
    holdout.client_from_object = Some(place);
    let tetrahedron = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 2 4\nf 2 3 4\nf 1 4 3\nf 1 3 2\n";
    let mut created = v1::CreateObjectRequest::new("mug", tetrahedron, 0.3);
    created.object_mut().regions = vec![v1::Region {
        shapes: vec![
            v1::Shape::ball(Vec3::ZERO, 0.05),
            v1::Shape::tube([Vec3::ZERO, Vec3::X], 0.1),
        ],
        ..v1::Region::new("rim", v1::Preference::Preferred)
    }];
    let mut rig = v1::CreateRigRequest::of_model("own", Vec::new());
    rig.models.clear();
    rig.joints = vec![joints.clone()];
    vec![
        of(&find.clone().with_presenting_hand(posed.clone())),
        of(&find
            .with_presenting_hand(joints.clone())
            .with_current(v1::CurrentGrasp::new(posed))),
        of(&v1::TrackFrame::of(3, holdout)),
        of(&created),
        of(&rig),
    ]
}

/// The contract's messages, and the names of the values of its enumerations.
struct Contract {
    messages: HashMap<String, DescriptorProto>,
    enums: HashMap<String, Vec<String>>,
}

impl Contract {
    fn new() -> Self {
        let set = FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).expect("the contract is sound");
        let (mut messages, mut enums) = (HashMap::new(), HashMap::new());
        for file in &set.file {
            for found in &file.enum_type {
                let names = found.value.iter().map(|value| value.name().to_owned()).collect();
                enums.insert(format!(".{}.{}", file.package(), found.name()), names);
            }
            for found in &file.message_type {
                messages.insert(format!(".{}.{}", file.package(), found.name()), found.clone());
            }
        }
        Self { messages, enums }
    }

    /// A message with all fields, and one alternative of each choice.
    fn full(&self, name: &str, choice: usize) -> Value {
        let message = &self.messages[name];
        let is_chosen = |field: &&FieldDescriptorProto| {
            if field.oneof_index.is_none() || field.proto3_optional() {
                return true;
            }
            let mut others = message
                .field
                .iter()
                .filter(|other| other.oneof_index == field.oneof_index);
            let count = others.clone().count();
            others.position(|other| other == *field) == Some(choice % count)
        };
        let fields = message.field.iter().filter(is_chosen);
        let fields = fields.filter_map(|field| {
            let value = self.value(field, choice)?;
            let is_list = field.label() == Label::Repeated && !is_map(field);
            Some((
                field.json_name().to_owned(),
                if is_list { json!([value]) } else { value },
            ))
        });
        Value::Object(fields.collect())
    }

    /// A value of a field; `None` for those that contradict others.
    fn value(&self, field: &FieldDescriptorProto, choice: usize) -> Option<Value> {
        let text = match field.name() {
            "rig" => "rigs/adult",
            "rig_id" | "group" | "groups" => "own",
            "mesh" | "model" | "models" | "piece" => "diAwIDAgMAp2IC4xIDAgMAp2IDAgLjEgMApmIDEgMiAzCg==",
            "name" | "object" => "objects/mug",
            _ => "a",
        };
        Some(match (field.r#type(), field.type_name()) {
            (Type::Bool, _) => json!(choice == 2),
            (Type::String | Type::Bytes, _) => json!(text),
            (Type::Enum, name) => json!(self.enums[name].get(choice + 1)?),
            (Type::Message, ".google.protobuf.Duration") => json!("0.25s"),
            (Type::Message, ".google.protobuf.Timestamp") => json!("2026-01-02T03:04:05Z"),
            (Type::Message, ".google.protobuf.FieldMask") => json!("regions,massKg"),
            (Type::Message, name) if name.ends_with("RadiiEntry") => json!({ "wrist": 0.02 }),
            (Type::Message, _) if is_map(field) => json!({ "a": "b" }),
            (Type::Message, ".grasp.v1.Quaternion") => json!({ "w": 1 }),
            (Type::Message, name) => self.full(name, choice),
            (Type::Float | Type::Double, _) => json!(0.25),
            _ => json!(1),
        })
    }
}

/// True for maps.
fn is_map(field: &FieldDescriptorProto) -> bool {
    field.type_name().ends_with("Entry")
}
