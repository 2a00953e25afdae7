//! Recovery: how long after an overload a light load is answered as before.

use std::time::Duration;

use crate::{
    Failure,
    bench::Bench,
    load::{End, HEAVY, LIGHT, Tally, find_grasp, open_loop},
    report::{Row, Unit},
};

/// Longest time until the latency is back, and the aim, in seconds.
const BACK_AFTER_S: [f64; 2] = [2.0, 1.0];

/// How much longer than before it may be.
const SLACK: f64 = 1.1;

/// Calls per second of the light load.
const LIGHT_RATE: f64 = 400.0;

/// Length of the light load before and after.
const AROUND: Duration = Duration::from_secs(5);

/// Time over which a p99 is taken, and by which the next such time is later.
const WINDOW: Duration = Duration::from_millis(500);
const STEP: Duration = Duration::from_millis(100);

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let rate = 10.0 * bench.saturation().await?;
    let server = bench.server(&[])?;
    let warm = find_grasp(server.address, LIGHT, &bench.requests.warm).await?;
    let searches = find_grasp(server.address, HEAVY, &bench.requests.searching).await?;
    let length = bench.seconds(60, 10);
    let end = AROUND + length;
    bench.step("recovery after 10 ×");
    let light = open_loop(warm, LIGHT_RATE, end + AROUND, 1);
    let heavy = async {
        tokio::time::sleep(AROUND).await;
        open_loop(searches, rate, length, 1).await
    };
    let (light, heavy) = tokio::join!(light, heavy);
    // The first calls read atlases.
    let before = windows(&light, AROUND / 2, AROUND);
    let usual = before.iter().map(|&(_, p99)| p99).fold(0.0, f64::max);
    let after = windows(&light, end, end + AROUND);
    let back = after.iter().find(|&&(_, p99)| p99 <= SLACK * usual);
    let first = after.first().map_or(f64::NAN, |&(_, p99)| p99);
    Ok(vec![Row::at_most(
        "recovery from 10 ×",
        Unit::Seconds,
        BACK_AFTER_S,
        back.map_or(f64::INFINITY, |&(start, _)| {
            start.saturating_sub(end).as_secs_f64()
        }),
        format!(
            "until p99 of {LIGHT_RATE}/s warm calls within {WINDOW:?} is at most {SLACK} × the worst of {:?} before, {usual:.1} ms; \
             at first {first:.1} ms; overload: {}",
            AROUND / 2,
            heavy.summary()
        ),
    )])
}

/// When windows between two moments begin, and their p99 in milliseconds; without an answer in time, more than any.
fn windows(light: &Tally, from: Duration, to: Duration) -> Vec<(Duration, f64)> {
    let starts = (0..)
        .map(|number| from + STEP * number)
        .take_while(|&start| start + WINDOW <= to);
    let p99 = |start| {
        let within = light
            .calls
            .iter()
            .filter(|call| (start..start + WINDOW).contains(&call.due));
        let times: Vec<f64> = within
            .map(|call| {
                if call.end == End::Served {
                    call.latency_ms
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        crate::report::quantile(&times, 0.99)
    };
    starts.map(|start| (start, p99(start))).collect()
}
