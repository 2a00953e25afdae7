//! Beside `GraspIt!`: the time to a first grasp on the same kinds of objects.
//!
//! Its `EigenGrasp` planner takes a median of 0.47 s to 0.65 s of processor time to a first force-closure grasp on a mug, a
//! flask and a phone; nobody holds them. Here a giver does, and the search's wall time counts.

use std::{fs, sync::Arc};

use grasp_proto::v1;
use grasp_tests::recorded::{data_folder_or_skip, object_of};

use crate::{
    Row,
    asking::{Answer, search_times, share},
    cold::without_atlas,
    setting::{Setting, Thing},
    table::{Line, Target, Unit, time},
};

/// The objects: files of the recorded data and usual masses in kilograms. A wineglass is the nearest to a flask.
const OBJECTS: [(&str, f32); 3] = [("osim_mug", 0.3), ("osim_wineglass", 0.15), ("osim_phone", 0.18)];

/// The shortest of its medians in seconds: the others make us look better.
const GRASPIT_MEDIAN: f64 = 0.47;

/// How many times faster we are to be.
const COLD_TIMES: f64 = 200.0;
const WARM_TIMES: f64 = 5000.0;

/// Requests an object at most.
const MOST_REQUESTS: usize = 300;

pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let Some(folder) = data_folder_or_skip("the comparison with GraspIt!") else {
        return Vec::new();
    };
    let things: Vec<Thing> = OBJECTS
        .iter()
        .map(|&(file, mass)| {
            let path = folder.join("objects").join(file).with_extension("obj");
            let obj = fs::read(path).expect("the mesh is there");
            let id = file.replace('_', "-");
            let object = Arc::new(object_of(&obj, mass));
            let create = v1::CreateObjectRequest {
                object_id: id.clone(),
                obj,
                mass_kg: mass,
                ..Default::default()
            };
            setting.thing(&id, object, Some(create))
        })
        .collect();
    let built_in = setting.built_in_things();
    let known: Vec<&Thing> = things.iter().chain(&built_in).collect();
    let server = setting.server_with_atlases(&known);
    let mut lines = Vec::new();
    for thing in &things {
        let requests = || thing.requests().into_iter().take(MOST_REQUESTS);
        let message = format!("cold, {}", thing.id());
        let cold = setting.ask_all(&server, &message, requests().map(without_atlas));
        lines.push(line(&format!("cold, {}", thing.id()), &cold, COLD_TIMES));
        let message = format!("warm, {}", thing.id());
        let warm = setting.ask_all(&server, &message, requests());
        lines.push(line(&format!("warm, {}", thing.id()), &warm, WARM_TIMES));
    }
    setting.serving.block_on(server.stop());
    lines
}

fn line(what: &str, answers: &[Answer], times: f64) -> Line {
    let spread = search_times(answers);
    let faster = GRASPIT_MEDIAN / spread.median;
    Line::new(Row::Graspit, what, Unit::Seconds, spread)
        .target(Target::at_least("faster", Unit::Times, faster, times))
        .remark(format!(
            "against {}; {:.1} % answered",
            time(GRASPIT_MEDIAN),
            100.0 * share(answers, |answer| answer.found)
        ))
}
