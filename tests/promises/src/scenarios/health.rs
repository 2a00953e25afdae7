//! Health: whether an overloaded server tells soon that it serves. Orchestrators restart one that does not.

use std::time::{Duration, Instant};

use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

use crate::{
    Failure,
    bench::{Bench, NO_ATLASES},
    load::{HEAVY, LIGHT, connect, find_grasp, milliseconds, open_loop},
    report::{Row, Unit, quantile},
};

/// Longest time of a check at the 99th percentile, and the aim, in milliseconds.
const CHECK_MS: [f64; 2] = [20.0, 5.0];

/// Time between checks.
const PAUSE: Duration = Duration::from_millis(10);

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let rate = 10.0 * bench.saturation().await?;
    let server = bench.server(NO_ATLASES)?;
    let mut client = HealthClient::new(connect(server.address, LIGHT).await?);
    let searches = find_grasp(server.address, HEAVY, &bench.requests.searching).await?;
    bench.step("health at 10 ×");
    let overload = tokio::spawn(open_loop(searches, rate, bench.seconds(60, 4), 1));
    let (mut times, mut wrong) = (Vec::new(), Vec::new());
    while !overload.is_finished() {
        tokio::time::sleep(PAUSE).await;
        let start = Instant::now();
        let checked = client.check(HealthCheckRequest::default()).await;
        times.push(milliseconds(start.elapsed()));
        match checked.map(|answer| answer.into_inner().status()) {
            Ok(ServingStatus::Serving) => {}
            Ok(status) => wrong.push(format!("{status:?}")),
            Err(status) => wrong.push(status.to_string()),
        }
    }
    let p99 = if wrong.is_empty() {
        quantile(&times, 0.99)
    } else {
        f64::INFINITY
    };
    let first_wrong = wrong
        .first()
        .map_or(String::new(), |first| format!(", the first: {first}"));
    Ok(vec![Row::at_most(
        "health check at 10 ×, p99",
        Unit::Milliseconds,
        CHECK_MS,
        p99,
        format!(
            "{} checks, {} not SERVING{first_wrong}; overload: {}",
            times.len(),
            wrong.len(),
            overload.await?.summary()
        ),
    )])
}
