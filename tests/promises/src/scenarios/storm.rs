//! Retry storm: clients that try refused calls again at once must not take the time that answers need.

use crate::{
    Failure,
    bench::{Bench, NO_ATLASES, Placement},
    load::{LIGHT, find_grasp, open_loop},
    report::{Row, Unit},
};

/// Least share of the peak, and the aim.
const OF_PEAK: [f64; 2] = [0.85, 0.9];

/// How often each call is sent.
const TRIES: usize = 3;

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let server = bench.server(NO_ATLASES)?;
    let call = find_grasp(server.address, LIGHT, &bench.requests.searching).await?;
    bench.step("saturation");
    let saturated = bench.saturate(call.clone(), Placement::Apart).await?.goodput();
    bench.step("retry storm at 2 ×");
    let tally = open_loop(call, 2.0 * saturated, bench.seconds(30, 3), TRIES).await;
    Ok(vec![Row::at_least(
        "goodput in a retry storm at 2 ×",
        Unit::Share,
        OF_PEAK,
        tally.goodput() / saturated.max(tally.goodput()),
        format!(
            "each call up to {TRIES} times, at once; peak {saturated:.0}/s; {}",
            tally.summary()
        ),
    )])
}
