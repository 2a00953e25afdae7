//! Capacity: figures for planning, which bind nobody.

use std::time::Duration;

use grasp_client::v1::{self, object_service_client::ObjectServiceClient};

use crate::{
    Failure,
    bench::Bench,
    load::{End, LIGHT, connect, find_grasp, open_loop},
    report::{Row, Unit},
    requests::BOX_OBJ,
};

/// Warm calls per second.
const WARM_RATE: f64 = 300.0;

/// Calls before those that are measured.
const WARM_UP: Duration = Duration::from_secs(2);

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    Ok(vec![cores(bench).await?, memory(bench).await?])
}

/// Cores per thousand warm calls a second.
async fn cores(bench: &Bench) -> Result<Row, Failure> {
    let server = bench.server(&["--builder-threads", "1"])?;
    let call = find_grasp(server.address, LIGHT, &bench.requests.warm).await?;
    bench.step("cores of warm calls");
    // Reads atlases, and learns grips where they have none.
    open_loop(call.clone(), WARM_RATE, WARM_UP, 1).await;
    let before = server.usage()?;
    let tally = open_loop(call, WARM_RATE, bench.seconds(30, 4), 1).await;
    let cores = server.spent_since(&before)?.total() / tally.seconds;
    let answered = tally.count(|end| matches!(end, End::Served | End::Unfound)) as f64 / tally.seconds;
    Ok(Row::stated(
        "cores per 1,000 warm calls a second",
        Unit::Cores,
        1e3 * cores / answered,
        format!(
            "{cores:.3} cores; median {:.2} ms; {}",
            tally.latency_ms(0.5, |_| true),
            tally.summary()
        ),
    ))
}

/// Memory per thousand small objects.
async fn memory(bench: &Bench) -> Result<Row, Failure> {
    let server = bench.server(&["--builder-threads", "0"])?;
    let mut client = ObjectServiceClient::new(connect(server.address, LIGHT).await?);
    let count = if bench.long { 1000 } else { 300 };
    bench.step(format_args!("memory of {count} objects"));
    let before = server.resident_bytes()?;
    for number in 0..count {
        client
            .create_object(v1::CreateObjectRequest::new(
                format!("box-{number}"),
                BOX_OBJ,
                0.1,
            ))
            .await?;
    }
    let bytes = server.resident_bytes()? - before;
    Ok(Row::stated(
        "memory per 1,000 objects",
        Unit::Mebibytes,
        bytes / f64::from(count) * 1e3 / f64::from(1 << 20),
        format!("{count} boxes of 12 triangles at rest: growth of resident memory"),
    ))
}
