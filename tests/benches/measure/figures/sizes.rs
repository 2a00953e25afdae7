//! Objects held out at other sizes than their own, with the atlases of their own sizes.

use grasp_tests::TestServer;

use crate::figures::{
    Row,
    requests::{Answer, search_times, share, within_50_ms},
    setting::Setting,
    table::{Line, Unit},
};

/// How many times as large as their own the objects are. Givers keep the pose in which they hold the object at its own size, so
/// larger objects reach into their hands.
const SCALES: [f32; 5] = [1.0, 0.5, 0.8, 1.25, 2.0];

/// Limit on requests per size.
const MAX_REQUESTS: usize = 300;

/// Requests that are not measured: the first ones prepare the object at its size.
const WARM_UP: usize = 15;

pub(crate) fn measure(setting: &Setting, server: &TestServer) -> Vec<Line> {
    let at = |scale: f32| {
        let requests = setting.built_in_requests().into_iter().take(MAX_REQUESTS);
        let resized = requests.map(|request| {
            let mut request = within_50_ms(request);
            request.holdout_mut().scale = Some(scale);
            request
        });
        let mut answers = setting.send_all(server, &format!("at {scale} times the size"), resized);
        let warm_up = WARM_UP.min(answers.len() / 2);
        line(scale, &answers.split_off(warm_up))
    };
    SCALES.map(at).to_vec()
}

fn line(scale: f32, answers: &[Answer]) -> Line {
    let spread = search_times(answers);
    Line::new(
        Row::Sizes,
        format!("the 15 holdouts × {scale}"),
        Unit::Seconds,
        spread,
    )
    .remark(format!(
        "{:.1} % answered in 50 ms",
        100.0 * share(answers, Answer::is_in_time)
    ))
}
