//! Refusals: how soon calls beyond the server's capacity are refused, and the cost.

use std::time::Duration;

use grasp_client::v1::grasp_service_client::GraspServiceClient;

use crate::{
    Failure,
    bench::{Bench, NO_ATLASES, Placement},
    load::{End, HEAVY, LIGHT, connect, find_grasp, open_loop},
    report::{Row, Unit},
    requests::impossible,
};

/// Longest time until a call is refused at the 99th percentile, and the aim, in milliseconds.
const LATENCY_MS: [f64; 2] = [5.0, 2.0];

/// Processor time of a refusal, and the aim, as a share of that of a served call.
const COST: [f64; 2] = [0.04, 0.02];

/// Refused calls per second: few enough that none waits for another.
const REFUSED_RATE: f64 = 500.0;

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let rate = 10.0 * bench.saturation().await?;
    let server = bench.server(NO_ATLASES)?;
    let call = find_grasp(server.address, LIGHT, &bench.requests.searching).await?;
    bench.step("cost of served calls");
    let before = server.usage()?;
    let saturated = bench.saturate(call.clone(), Placement::Apart).await?;
    let served = saturated.count(|end| matches!(end, End::Served | End::Unfound)) as f64;
    let cost_served = server.spent_since(&before)?.total() / served;
    bench.step("refusals at 10 ×");
    let tally = open_loop(call, rate, bench.seconds(30, 3), 1).await;
    let latency = tally.latency_ms(0.99, |end| end == End::Refused);
    let (cost_refused, count) = cost_of_refusal(bench).await?;
    Ok(vec![
        Row::at_most(
            "refusals, p99",
            Unit::Milliseconds,
            LATENCY_MS,
            latency,
            format!("at 10 ×, from when the call was due; {}", tally.summary()),
        ),
        Row::at_most(
            "processor time of a refusal, of a served call's",
            Unit::Share,
            COST,
            cost_refused / cost_served,
            format!(
                "{:.0} µs of {:.0} µs; {count} refusals by a server of one search that another client runs",
                1e6 * cost_refused,
                1e6 * cost_served
            ),
        ),
    ])
}

/// Processor seconds per refusal, beside a search that occupies the only place; and the number of refusals.
async fn cost_of_refusal(bench: &Bench) -> Result<(f64, usize), Failure> {
    let mut flags = NO_ATLASES.to_vec();
    flags.extend(["--maximum-searches", "1", "--maximum-budget-ms", "600000"]);
    let server = bench.server(&flags)?;
    let call = find_grasp(server.address, LIGHT, &bench.requests.searching).await?;
    let other = connect(server.address, HEAVY).await?;
    let hopeless = impossible(&other, Duration::from_mins(10)).await?;
    bench.step("cost of refusals");
    let occupying = tokio::spawn(async move { GraspServiceClient::new(other).find_grasp(hopeless).await });
    tokio::time::sleep(Duration::from_millis(300)).await;
    let length = bench.seconds(20, 3);
    let before = server.usage()?;
    tokio::time::sleep(length).await;
    let idle = server.spent_since(&before)?.other;
    let before = server.usage()?;
    let tally = open_loop(call, REFUSED_RATE, length, 1).await;
    let spent = server.spent_since(&before)?.other - idle;
    occupying.abort();
    let refused = tally.count(|end| end == End::Refused);
    if refused * 10 < tally.calls.len() * 9 {
        return Err(format!("too few calls were refused: {}", tally.summary()).into());
    }
    Ok((spent / refused as f64, refused))
}
