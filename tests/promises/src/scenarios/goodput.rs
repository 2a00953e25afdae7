//! Goodput: searches found within their deadline, as their clients see it, at once to ten times the load that the server can take.

use std::sync::Arc;

use grasp_client::v1::FindGraspRequest;

use crate::{
    Failure,
    bench::{Bench, NO_ATLASES, Placement},
    load::{End, LIGHT, Tally, find_grasp, open_loop},
    report::{Row, Unit},
    requests::Requests,
};

/// Loads, in multiples of saturation.
const MULTIPLES: [u32; 4] = [1, 2, 4, 10];

/// Least shares of the peak, and the aims, by multiples.
const TARGETS: [(u32, [f64; 2]); 2] = [(4, [0.85, 0.9]), (10, [0.75, 0.8])];

/// Least share of admitted calls that are answered in time, and the aim.
const IN_TIME: [f64; 2] = [0.999, 0.9999];

/// Loads beside the promised ones: fewer, as they only explain.
const FEWER_MULTIPLES: [u32; 2] = [4, 10];

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let Requests {
        searching,
        equal,
        warm,
    } = &bench.requests;
    let searches = curve(bench, Placement::Apart, NO_ATLASES, searching, &MULTIPLES).await?;
    let equal = curve(bench, Placement::Apart, NO_ATLASES, equal, &MULTIPLES).await?;
    let mut rows = Vec::new();
    for (multiple, bounds) in TARGETS {
        for (curve, calls) in [(&searches, "searches"), (&equal, "searches that cost the same")] {
            let (share, how) = curve.at(multiple);
            rows.push(Row::at_least(
                &format!("goodput at {multiple} ×, {calls}"),
                Unit::Share,
                bounds,
                share,
                how,
            ));
        }
    }
    rows.push(deadlines(&[&searches, &equal]));
    let together = curve(
        bench,
        Placement::Together,
        NO_ATLASES,
        searching,
        &FEWER_MULTIPLES,
    );
    let together = bench.unpinned(together).await?;
    let warm = curve(bench, Placement::Apart, &[], warm, &FEWER_MULTIPLES).await?;
    for multiple in FEWER_MULTIPLES {
        for (curve, calls) in [(&together, "generator on the same cores"), (&warm, "warm calls")] {
            let (share, how) = curve.at(multiple);
            rows.push(Row::stated(
                &format!("goodput at {multiple} ×, {calls}"),
                Unit::Share,
                share,
                how,
            ));
        }
    }
    Ok(rows)
}

/// The share of admitted calls that were answered in time.
fn deadlines(curves: &[&Curve]) -> Row {
    let loads = || {
        curves
            .iter()
            .flat_map(|curve| &curve.at_multiples)
            .map(|(_, tally)| tally)
    };
    let late: usize = loads().map(|tally| tally.count(|end| end == End::Late)).sum();
    let answered: usize = loads()
        .map(|tally| tally.count(|end| matches!(end, End::Served | End::Unfound)))
        .sum();
    Row::at_least(
        "deadlines of admitted calls",
        Unit::Share,
        IN_TIME,
        answered as f64 / (answered + late) as f64,
        format!("{late} of {} calls of all these loads were late", answered + late),
    )
}

/// Goodput at several loads.
struct Curve {
    saturated: Tally,
    at_multiples: Vec<(u32, Tally)>,
}

impl Curve {
    /// The share of the peak at a multiple of saturation, and how it came about.
    fn at(&self, multiple: u32) -> (f64, String) {
        let loads = self.at_multiples.iter().map(|(_, tally)| tally);
        let peak = loads.map(Tally::goodput).fold(self.saturated.goodput(), f64::max);
        let at = self.at_multiples.iter().find(|&&(other, _)| other == multiple);
        let tally = &at.expect("every multiple is measured").1;
        let how = format!(
            "peak {peak:.0}/s, saturation {:.0}/s; {}",
            self.saturated.goodput(),
            tally.summary()
        );
        (tally.goodput() / peak, how)
    }
}

async fn curve(
    bench: &Bench,
    placement: Placement,
    flags: &[&str],
    requests: &Arc<[FindGraspRequest]>,
    multiples: &[u32],
) -> Result<Curve, Failure> {
    let server = bench.server_at(placement, flags)?;
    let call = find_grasp(server.address, LIGHT, requests).await?;
    bench.step("saturation");
    let saturated = bench.saturate(call.clone(), placement).await?;
    let mut at_multiples = Vec::new();
    for &multiple in multiples {
        bench.step(format_args!("goodput at {multiple} ×"));
        let rate = f64::from(multiple) * saturated.goodput();
        let load = open_loop(call.clone(), rate, bench.seconds(30, 3), 1);
        at_multiples.push((multiple, load.await));
    }
    Ok(Curve {
        saturated,
        at_multiples,
    })
}
