//! Comparison with `GraspIt!`: the time to a first grasp on the same kinds of objects.
//!
//! Its `EigenGrasp` planner takes a median of 0.47 s to 0.65 s of processor time to a first force-closure grasp on a
//! mug, a flask and a phone that no hand holds. Here a giver holds them, and wall time of the search counts.

use std::{fs, sync::Arc};

use grasp_proto::v1;
use grasp_tests::recorded::{data_folder_or_skip, object_of};

use crate::figures::{
    Row,
    cold::without_atlas,
    requests::{Answer, search_times, share},
    setting::{Setting, TestObject},
    table::{Line, Target, Unit, time},
};

/// Objects: files of the recorded data and usual masses in kilograms. A wineglass is closest to a flask.
const OBJECTS: [(&str, f32); 3] = [("osim_mug", 0.3), ("osim_wineglass", 0.15), ("osim_phone", 0.18)];

/// The shortest of its published medians in seconds; the others would flatter us.
const GRASPIT_MEDIAN: f64 = 0.47;

/// Targets: how many times faster this service is.
const COLD_SPEEDUP: f64 = 200.0;
const WARM_SPEEDUP: f64 = 5000.0;

/// Limit on requests per object.
const MAX_REQUESTS: usize = 300;

pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let Some(folder) = data_folder_or_skip("the comparison with GraspIt!") else {
        return Vec::new();
    };
    let test_objects: Vec<TestObject> = OBJECTS
        .iter()
        .map(|&(file, mass)| {
            let path = folder.join("objects").join(file).with_extension("obj");
            let obj = fs::read(path).expect("the mesh is there");
            let id = file.replace('_', "-");
            let object = Arc::new(object_of(&obj, mass));
            let create = v1::CreateObjectRequest::new(&id, obj, mass);
            setting.test_object(&id, object, Some(create))
        })
        .collect();
    let built_in = setting.built_in_test_objects();
    let known: Vec<&TestObject> = test_objects.iter().chain(&built_in).collect();
    let server = setting.server_with_atlases(&known);
    let mut lines = Vec::new();
    for test_object in &test_objects {
        let requests = || test_object.requests().into_iter().take(MAX_REQUESTS);
        let message = format!("cold, {}", test_object.id());
        let cold = setting.send_all(&server, &message, requests().map(without_atlas));
        lines.push(line(&format!("cold, {}", test_object.id()), &cold, COLD_SPEEDUP));
        let message = format!("warm, {}", test_object.id());
        let warm = setting.send_all(&server, &message, requests());
        lines.push(line(&format!("warm, {}", test_object.id()), &warm, WARM_SPEEDUP));
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
