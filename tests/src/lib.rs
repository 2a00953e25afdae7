//! Shared by integration tests, benches and promises: a server inside the process, its certificates, a client by hand, attacks,
//! recorded hands, placed givers, and random holdouts.

pub mod attacks;
pub mod certificates;
mod harness;
pub mod random_holdouts;
pub mod raw;
pub mod recorded;

pub use harness::{StoppingServer, TestServer, wire_pose};

/// The weights of the score against recorded pairs of valid grasps: one plausible, and one not,
/// for the reason in the table. `tests/results/measured-once.md` says how they were found.
#[cfg(test)]
mod pairs {
    use grasp_synthesis::model::score::{RegionTerm, Score, TERMS};

    /// Least share of the pairs that the weights have to rank right.
    const MIN_SHARE_RIGHT: f32 = 0.75;

    #[test]
    fn weights_rank_most_pairs_right() {
        let (mut count, mut wrong) = (0, Vec::new());
        for line in include_str!("pairs.csv").lines().skip(1) {
            let mut fields = line.split(',');
            let about = fields.by_ref().take(2).collect::<Vec<_>>().join(", ");
            let values: Vec<f32> = fields
                .map(|value| value.parse().expect("a value is a number"))
                .collect();
            let totals = [0, TERMS].map(|first| {
                let values = values[first..first + TERMS]
                    .try_into()
                    .expect("there is a value for each term");
                let regions = [None; RegionTerm::ALL.len()];
                Score { values, regions }.total()
            });
            count += 1;
            if totals[0] <= totals[1] {
                wrong.push(format!("{about}: {totals:?}"));
            }
        }
        assert!(count >= 40, "{count} pairs");
        let right = 1.0 - wrong.len() as f32 / count as f32;
        assert!(
            right >= MIN_SHARE_RIGHT,
            "{right} of {count} are right; wrong are:\n{}",
            wrong.join("\n")
        );
    }
}
