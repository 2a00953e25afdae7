//! Every request's message, and packed grasps. The first byte says which.

#![no_main]

use grasp_fuzz::{LONGEST, Target, fuzz, requests};
use grasp_proto::v1;
use grasp_server::fuzzing::{message_of_json, read_request, request_names};

fn read(input: &[u8]) {
    let Some((&place, message)) = input.split_first() else {
        return;
    };
    let place = usize::from(place) % (request_names().count() + 1);
    if place < request_names().count() {
        read_request(place, message);
    } else if let Ok(grasp) = v1::Grasp::unpack(message) {
        let _ = grasp.pack();
    }
}

/// A message with as many copies of the encoded field as a request may have bytes.
fn repeated(name: &str, outer: u8, field: &[u8]) -> Vec<u8> {
    let place = request_names()
        .position(|known| known == name)
        .expect("it is a request");
    let content = field.repeat((160 << 10) / field.len() - 4);
    let mut message = vec![place as u8, outer << 3 | 2];
    prost::encode_length_delimiter(content.len(), &mut message).expect("there is room");
    message.extend(content);
    message
}

fuzz!(Target {
    read,
    seeds: || {
        let of = |(place, json): (usize, serde_json::Value)| {
            let message = message_of_json(place, json.to_string().as_bytes()).expect("it is the contract's");
            [vec![place as u8], message].concat()
        };
        let mut seeds: Vec<_> = requests().into_iter().map(of).collect();
        let grasp = v1::Grasp {
            hand: Some(v1::HandPose::new("rigs/adult", v1::Handedness::Left)),
            ..Default::default()
        };
        seeds.push([vec![request_names().count() as u8], grasp.pack()].concat());
        seeds
    },
    dense: || vec![
        repeated("FindGraspRequest", 1, b"\x2a\0"),
        repeated("FindGraspRequest", 1, b"\x22\0"),
        repeated("TrackFrame", 4, b"\x2a\0"),
        repeated("TrackFrame", 4, b"\x22\0"),
        repeated("CreateObjectRequest", 1, b"\x3a\0"),
        repeated("CreateObjectRequest", 1, b"\x42\0"),
        repeated("CreateObjectRequest", 1, b"\x1a\0"),
    ],
    longest: LONGEST,
    dense_bytes_per_byte: 4,
    words: Vec::new,
});
