//! The overhead of gRPC: a replayed attempt over loopback against the same replay as a plain call, and a listing.

use criterion::{Criterion, criterion_group};
use grasp_client::{Outcome, built_in::request_for, v1};
use grasp_synthesis::model::strategy::Strategy;
use grasp_tests::{TestServer, searches::Bench};

fn round_trip(criterion: &mut Criterion) {
    let runtime = tokio::runtime::Runtime::new().expect("a runtime can be started");
    let server = runtime.block_on(TestServer::start());
    let client = runtime.block_on(server.client());

    // A known valid attempt: the search takes a few microseconds, the rest is the round trip.
    let bench = Bench::new(1);
    let holdout = bench.holdouts.len() - 1;
    let attempt = bench
        .search(holdout, Strategy::F, 1, 0, u64::MAX)
        .report
        .attempt
        .expect("the holdout has a valid grasp");
    let mut request = request_for(bench.holdouts[holdout].0).with_seed(1);
    request.search_mut().replay_attempt = Some(attempt);
    request.requirements_mut().thesis = Some(v1::ThesisOptions {
        thesis_validity: true,
        ..v1::ThesisOptions::default()
    });

    let mut group = criterion.benchmark_group("round trip");
    group.bench_function("replay, plain call", |bencher| {
        bencher.iter(|| {
            // The server poses the giver's hand per request, so the plain call must too.
            let holdout = bench.holdouts[holdout]
                .0
                .to_holdout()
                .expect("the holdout is sound");
            let outcome = bench.search_on(&holdout, Strategy::F, 1, attempt, 1);
            assert!(outcome.grasp.is_some());
        });
    });
    group.bench_function("replay, over gRPC", |bencher| {
        bencher.to_async(&runtime).iter(|| async {
            let answer = client.find_grasp(&request).await.expect("the request is valid");
            assert_eq!(answer.outcome(), Outcome::Found);
        });
    });
    group.bench_function("list objects", |bencher| {
        bencher.to_async(&runtime).iter(|| async {
            client
                .list_objects(&v1::ListObjectsRequest::default())
                .await
                .expect("the server lists its objects")
        });
    });
    group.finish();
    runtime.block_on(server.stop());
}

criterion_group!(benches, round_trip);
