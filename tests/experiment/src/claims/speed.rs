//! The whole ladder (end of 5.6).

use grasp_synthesis::model::strategy::Strategy::{A, E, F};

use super::{Claim, verdict_of_ratio};
use crate::{data::Data, plan::Set, tables::column_means};

pub(super) fn claims(data: &Data<'_>) -> Vec<Claim> {
    let means = |strategy| column_means(data, Set::ladder(strategy));
    let mut claims = Vec::new();
    if let (Some(e), Some(f)) = (means(E), means(F)) {
        claims.push(Claim {
            source: "5.6",
            thesis: "taking the first sufficient force distribution changes neither attempts nor time visibly",
            run: format!("attempts times {:.2}, time times {:.2}", f.0 / e.0, f.1 / e.1),
            verdict: verdict_of_ratio(f.1 / e.1, 5_000.0 / 5_162.0),
            why: "",
        });
    }
    if let (Some(a), Some(f)) = (means(A), means(F)) {
        claims.push(Claim {
            source: "5.6",
            thesis: "from A to F success becomes 30 times as likely",
            run: format!("{:.1} times", a.0 / f.0),
            verdict: verdict_of_ratio(a.0 / f.0, 30.0),
            why: "the palm-CoM-palm angle gains less here, and one random bend ratio costs grasps (above)",
        });
        claims.push(Claim {
            source: "5.6",
            thesis: "and F takes 3.6 % of the time of A",
            run: format!("{:.0} %", 100.0 * f.1 / a.1),
            verdict: verdict_of_ratio(a.1 / f.1, 137_138.0 / 5_000.0),
            why: "a naive attempt that is out of reach is nearly free here, so A is slow by its number of attempts \
                  alone; what the later steps save in the thesis was never spent",
        });
    }
    claims
}
