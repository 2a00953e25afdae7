//! Independence of the random streams of attempts.

use crate::prelude::*;

#[test]
fn streams_of_neighbouring_seeds_and_attempts_share_nothing() {
    let mut seen = HashSet::new();
    for seed in 0..40 {
        for attempt in 0..40 {
            let mut stream = AttemptStream::new(seed, attempt);
            // Several windows of each stream catch one that is another one shifted.
            for _ in 0..8 {
                let window = [stream.unit(), stream.unit(), stream.unit()].map(f32::to_bits);
                assert!(seen.insert(window), "seed {seed}, attempt {attempt}");
            }
        }
    }
}
