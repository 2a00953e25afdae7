//! Retry storm: clients that try refused calls again at once must not take the time that answers need.

use crate::{
    Failure,
    bench::{Bench, CONNECTIONS, DEADLINE, NO_ATLASES, Placement},
    load::{LIGHT, OpenLoop, connect, find_grasp},
    report::{Row, Unit},
};

/// Least share of the peak, and the aim.
const OF_PEAK: [f64; 2] = [0.85, 0.9];

/// How often each call is sent.
const TRIES: usize = 3;

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let server = bench.server(NO_ATLASES)?;
    let channels = connect(server.address, LIGHT, CONNECTIONS).await?;
    let call = find_grasp(&channels, &bench.requests.searching);
    bench.step("saturation");
    let saturated = bench.saturate(call.clone(), Placement::Apart).await.goodput();
    let load = OpenLoop {
        rate: 2.0 * saturated,
        length: bench.seconds(30, 3),
        deadline: DEADLINE,
        tries: TRIES,
        seed: 1,
    };
    bench.step("retry storm at 2 ×");
    let tally = load.run(call).await;
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
