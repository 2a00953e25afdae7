//! Every request's message, and packed grasps. The first byte says which.

#![no_main]

use grasp_fuzz::{LONGEST, Target, bounded_as_all, fuzz, requests};
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

/// Messages with an encoded field that takes much memory many times: some are refused, and some just not.
fn repeated(name: &str, outer: u8, field: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    let place = request_names()
        .position(|known| known == name)
        .expect("it is a request");
    (6..14).map(move |power| {
        let content = field.repeat(3 << power);
        let mut message = vec![place as u8, outer << 3 | 2];
        prost::encode_length_delimiter(content.len(), &mut message).expect("there is room");
        message.extend(content);
        message
    })
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
    dense: || {
        let fields: [(&str, u8, &[u8]); 9] = [
            // Hands, and ones of one joint.
            ("FindGraspRequest", 1, b"\x22\0"),
            ("FindGraspRequest", 1, b"\x22\x04\x12\x02\x12\0"),
            ("TrackFrame", 4, b"\x22\0"),
            // Obstacles, and tubes of one point.
            ("TrackFrame", 4, b"\x2a\0"),
            ("FindGraspRequest", 1, b"\x2a\x04\x0a\x02\x0a\0"),
            // Regions, and ones of one shape; known grips; names of parts.
            ("CreateObjectRequest", 1, b"\x3a\0"),
            ("CreateObjectRequest", 1, b"\x3a\x02\x32\0"),
            ("CreateObjectRequest", 1, b"\x42\0"),
            ("CreateObjectRequest", 1, b"\x5a\0"),
        ];
        let inputs = fields
            .iter()
            .flat_map(|&(name, outer, field)| repeated(name, outer, field));
        bounded_as_all(inputs)
    },
    longest: LONGEST,
    words: Vec::new,
});
