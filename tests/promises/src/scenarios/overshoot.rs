//! Overshoot: how long after its deadline a client gets the answer of a search that finds nothing, from an idle server.

use std::time::{Duration, Instant};

use grasp_tests::raw::{Connection, framed};

use crate::{
    Failure,
    bench::{Bench, FIND_GRASP, NO_ATLASES, WINDOW},
    load::{LIGHT, connect, milliseconds, socket},
    report::{Row, Unit, quantile},
    requests::impossible,
};

/// Longest overshoot at the 99.9th percentile, and the aim, in milliseconds.
const OVERSHOOT_MS: [f64; 2] = [3.0, 2.0];

/// Shortest and longest deadline, in milliseconds.
const DEADLINES_MS: [u64; 2] = [20, 200];

/// The status of a call that was not answered before its deadline; nothing else may answer one.
const DEADLINE_EXCEEDED: &str = "4";

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let server = bench.server(NO_ATLASES)?;
    let channel = connect(server.address, LIGHT).await?;
    let hopeless = impossible(&channel, Duration::from_secs(10)).await?;
    let mut connection = Connection::over(socket(server.address, LIGHT).await?, WINDOW).await?;
    let [shortest, longest] = DEADLINES_MS;
    let calls: u64 = if bench.long { 1500 } else { 150 };
    let mut overshoots = Vec::new();
    for number in 0..calls {
        bench.step(format_args!("overshoot, call {number} of {calls}"));
        // Steps by a number that shares no factor with the range visit all of it.
        let deadline = Duration::from_millis(shortest + (number * 67) % (longest - shortest + 1));
        let timeout = format!("{}u", deadline.as_micros());
        let start = Instant::now();
        let call = connection.call(FIND_GRASP, &[("grpc-timeout", &timeout)]).await;
        let (answer, mut request) = call.ok_or("the connection is closed")?;
        request.send_data(framed(&hopeless).into(), true)?;
        let answer = answer.await?;
        // Only errors have it in their headers.
        let error = answer.headers().get("grpc-status").cloned();
        let mut body = answer.into_body();
        while let Some(data) = body.data().await {
            body.flow_control().release_capacity(data?.len())?;
        }
        body.trailers().await?;
        if error.is_none_or(|code| code == DEADLINE_EXCEEDED) {
            overshoots.push(milliseconds(start.elapsed().saturating_sub(deadline)));
        }
    }
    if overshoots.len() * 20 < calls as usize * 19 {
        return Err(format!("only {} of {calls} calls were answered", overshoots.len()).into());
    }
    let worst = overshoots.iter().copied().fold(0.0, f64::max);
    let late = overshoots.iter().filter(|&&overshoot| overshoot > 0.0).count();
    Ok(vec![Row::at_most(
        "overshoot of deadlines, p99.9",
        Unit::Milliseconds,
        OVERSHOOT_MS,
        quantile(&overshoots, 0.999),
        format!(
            "idle server, {} of {calls} hopeless searches answered, deadlines of {shortest} to {longest} ms; {late} answers after the deadline, the last by {worst:.2} ms",
            overshoots.len()
        ),
    )])
}
