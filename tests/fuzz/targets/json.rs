//! Every request as JSON. The first byte says which.

#![no_main]

use grasp_fuzz::{Target, fuzz, names, requests};
use grasp_server::fuzzing::{message_of_json, read_request, request_names};

fn read(input: &[u8]) {
    let Some((&place, text)) = input.split_first() else {
        return;
    };
    if let Ok(message) = message_of_json(place.into(), text) {
        read_request(place.into(), &message);
    }
}

fuzz!(Target {
    read,
    seeds: || {
        let seeds = requests().into_iter();
        seeds
            .map(|(place, json)| [vec![place as u8], json.to_string().into_bytes()].concat())
            .collect()
    },
    dense: || {
        // As many values as a request may have.
        let numbers = "0,".repeat(80_000);
        let regions = format!(r#"{{"object":{{"regions":[{{"triangles":[{numbers}0]}}]}}}}"#);
        let objects = format!(r#"{{"object":{{"regions":[{}{{}}]}}}}"#, "{},".repeat(40_000));
        let labels = (0..20_000)
            .map(|label| format!(r#""{label}":"","#))
            .collect::<String>();
        let labels = format!(r#"{{"object":{{"labels":{{{labels}"a":""}}}}}}"#);
        let place = request_names()
            .position(|name| name == "CreateObjectRequest")
            .expect("it is a request");
        [regions, objects, labels]
            .map(|text| (100, [&[place as u8], text.as_bytes()].concat()))
            .to_vec()
    },
    longest: 8 << 10,
    words: names,
});
