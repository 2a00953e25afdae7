//! Capacity: figures for planning, which bind nobody.

use std::time::{Duration, Instant};

use grasp_client::{
    GraspClient,
    v1::{self, object_service_client::ObjectServiceClient},
};
use grasp_server::new_token;
use grasp_tests::certificates::{Authority, TestFolder};

use crate::{
    Failure,
    bench::Bench,
    load::{End, LIGHT, connect, find_grasp, milliseconds, open_loop},
    report::{Row, Unit, quantile},
    requests::BOX_OBJ,
};

/// Warm calls per second.
const WARM_RATE: f64 = 300.0;

/// Calls before those that are measured.
const WARM_UP: Duration = Duration::from_secs(2);

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    Ok(vec![
        cores(bench).await?,
        memory(bench).await?,
        security(bench).await?,
    ])
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

/// The latency that encryption and a token add: the same calls to two servers in turn, one at a time.
async fn security(bench: &Bench) -> Result<Row, Failure> {
    let (authority, folder) = (Authority::default(), TestFolder::new("promises"));
    let issued = authority.issue("a server");
    let (secret, tokens) = new_token("studio")?;
    let [certificate, key, tokens] = [
        ("server.pem", issued.certificate),
        ("server.key", issued.key),
        ("tokens.toml", tokens),
    ]
    .map(|(name, content)| folder.write(name, content).display().to_string());
    let mut flags = vec!["--builder-threads", "1"];
    let plain = bench.server(&flags)?;
    flags.extend(["--tls-certificate", &certificate, "--tls-key", &key]);
    flags.extend(["--tokens-file", &tokens]);
    let secure = bench.server(&flags)?;
    let clients = [
        GraspClient::connect(format!("http://{}", plain.address)).await?,
        GraspClient::builder(format!("https://{}", secure.address))
            .ca_certificate(authority.certificate())
            .token(&secret)?
            .connect()
            .await?,
    ];
    bench.step("latency of TLS and a token");
    let requests = &bench.requests.warm;
    let (mut latencies, mut added) = ([const { Vec::new() }; 2], Vec::new());
    let pairs = if bench.long { 10_000 } else { 2_000 };
    for number in 0..requests.len() + pairs {
        let request = &requests[number % requests.len()];
        let mut both = [0.0; 2];
        for (client, latency) in clients.iter().zip(&mut both) {
            let sent = Instant::now();
            client.find_grasp(request).await?;
            *latency = milliseconds(sent.elapsed());
        }
        // The first round reads atlases.
        if number >= requests.len() {
            added.push(both[1] - both[0]);
            for (all, one) in latencies.iter_mut().zip(both) {
                all.push(one);
            }
        }
    }
    let [without, with] = latencies.map(|all| quantile(&all, 0.5));
    Ok(Row::stated(
        "latency that TLS and a token add",
        Unit::Milliseconds,
        quantile(&added, 0.5),
        format!("median of {pairs} pairs of warm calls; medians {without:.2} and {with:.2} ms"),
    ))
}
