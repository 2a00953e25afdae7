//! Fairness: a client that keeps to its share is served as if it were alone, whatever another one does.

mod greedy;
mod modest;

use std::time::Duration;

use crate::{
    Failure,
    bench::{Bench, NO_ATLASES},
    load::{Call, LIGHT, find_grasp, open_loop},
    report::{Row, Unit},
    server::ServerProcess,
};

/// Least share of the light client's goodput alone, and the aim.
const OF_SOLO: [f64; 2] = [0.9, 0.95];

/// The light client's searches, as a share of saturation.
const LIGHT_SHARE: f64 = 0.2;

/// Time between the light client's uses of the contested resource.
const PROBE_EVERY: Duration = Duration::from_millis(200);

/// Time for the heavy client to take all it can get.
const TAKES: Duration = Duration::from_millis(500);

/// A resource that the heavy client takes.
#[derive(Clone, Copy, Debug)]
enum Resource {
    /// Searches at ten times saturation.
    Searches,
    /// Streams of grasps with budgets of ten seconds.
    Streams,
    /// Tracks, most of them forgotten, and frames of some.
    Tracks,
    /// Uploads that trickle.
    Uploads,
    /// Meshes that it does not read.
    Meshes,
    /// Watches.
    Watches,
    /// Rigs, which it keeps.
    Rigs,
    /// Connections on which it says nothing.
    Connections,
}

impl Resource {
    const ALL: [Self; 8] = [
        Self::Searches,
        Self::Streams,
        Self::Tracks,
        Self::Uploads,
        Self::Meshes,
        Self::Watches,
        Self::Rigs,
        Self::Connections,
    ];
}

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let saturation = bench.saturation().await?;
    let server = bench.server(NO_ATLASES)?;
    bench.step("fairness: a light client alone");
    let searches = light(bench, &server).await?;
    let solo = open_loop(searches, LIGHT_SHARE * saturation, length(bench), 1).await;
    let mut rows = Vec::new();
    for resource in Resource::ALL {
        bench.step(format_args!("fairness: {resource:?}"));
        // A server of its own, so that nothing is left of the attack before.
        let server = bench.server(NO_ATLASES)?;
        let modest = modest::Modest::new(&server, resource).await?;
        let searches = light(bench, &server).await?;
        let greedy = greedy::attack(bench, &server, resource, 10.0 * saturation).await?;
        tokio::time::sleep(TAKES).await;
        let probes = tokio::spawn(modest.uses(PROBE_EVERY, length(bench)));
        let beside = open_loop(searches, LIGHT_SHARE * saturation, length(bench), 1).await;
        let probes = probes.await?;
        drop(greedy);
        let of_solo = beside.goodput() / solo.goodput();
        rows.push(Row::at_least(
            &format!("fairness beside {}", format!("{resource:?}").to_lowercase()),
            Unit::Share,
            OF_SOLO,
            of_solo.min(probes.share()),
            format!(
                "{:.0} % of {:.0}/s alone, p99 {:.0} ms instead of {:.0} ms; {probes}",
                100.0 * of_solo,
                solo.goodput(),
                beside.latency_ms(0.99, |_| true),
                solo.latency_ms(0.99, |_| true),
            ),
        ));
    }
    Ok(rows)
}

fn length(bench: &Bench) -> Duration {
    bench.seconds(20, 3)
}

/// The light client's searches.
async fn light(bench: &Bench, server: &ServerProcess) -> Result<Call, Failure> {
    Ok(find_grasp(server.address, LIGHT, &bench.requests.searching).await?)
}
