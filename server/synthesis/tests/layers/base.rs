//! Independence and distributions of the random streams of attempts.

use crate::prelude::*;

#[test]
fn streams_of_neighbouring_seeds_and_attempts_share_nothing() {
    let mut seen = HashSet::new();
    for seed in 0..40 {
        for attempt in 0..40 {
            let mut stream = AttemptStream::new(seed, attempt);
            // Several windows of each stream catch a stream that is a shifted copy of another.
            for _ in 0..8 {
                let window = [stream.unit(), stream.unit(), stream.unit()].map(f32::to_bits);
                assert!(seen.insert(window), "seed {seed}, attempt {attempt}");
            }
        }
    }
}

/// Taken over many streams, since poor mixing of seed and index would distort the moments.
#[test]
fn draws_have_the_moments_of_their_distributions() {
    let rounds = 20_000_u32;
    let (mut unit, mut unit_squared, mut cube) = (0.0, 0.0, Vec3::ZERO);
    let (mut axes, mut squares, mut picks) = (Vec3::ZERO, Vec3::ZERO, [0_u32; 3]);
    for attempt in 0..rounds {
        let mut stream = AttemptStream::new(1, u64::from(attempt));
        let value = stream.unit();
        assert!((0.0..1.0).contains(&value));
        unit += f64::from(value);
        unit_squared += f64::from(value * value);
        let point = stream.in_cube();
        assert!(point.abs().max_element() <= 1.0);
        cube += point;
        let rotation = stream.rotation();
        assert!(rotation.is_normalized());
        let axis = rotation * Vec3::Y;
        axes += axis;
        squares += axis * axis;
        picks[stream.below(3)] += 1;
    }
    let n = f64::from(rounds);
    // Four standard deviations each.
    assert!((unit / n - 0.5).abs() < 4.0 * (1.0 / 12.0 / n).sqrt());
    assert!((unit_squared / n - 1.0 / 3.0).abs() < 4.0 * (4.0 / 45.0 / n).sqrt());
    let slack = 4.0 * (1.0 / 3.0 / n).sqrt() as f32;
    assert!((cube / n as f32).abs().max_element() < slack);
    assert!((axes / n as f32).abs().max_element() < slack);
    assert!((squares / n as f32 - 1.0 / 3.0).abs().max_element() < 4.0 * (4.0 / 45.0 / n).sqrt() as f32);
    assert!(
        picks
            .iter()
            .all(|&pick| (f64::from(pick) - n / 3.0).abs() < 4.0 * (n * 2.0 / 9.0).sqrt())
    );
}
