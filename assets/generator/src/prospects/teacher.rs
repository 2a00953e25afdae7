//! Teaches a network by examples: logistic loss, Adam (Kingma and Ba, 2015) on small batches, a rate that falls to nothing.

use std::f64::consts::PI;

use grasp_synthesis::{
    base::random::AttemptStream,
    propose::success_prior::{INPUTS, Network, UNITS},
};

use super::examples::Example;

/// Times that every example is seen.
const EPOCHS: u64 = 12;

/// Examples of a batch.
const BATCH: usize = 512;

/// How far a number goes at first in a step.
const RATE: f64 = 3e-3;

/// How strongly weights are drawn to zero.
const DECAY: f32 = 1e-4;

/// Shares of old means of the gradient and its square, and the least root of the latter: as the paper proposes.
const MEMORY: [f32; 2] = [0.9, 0.999];
const LEAST_ROOT: f32 = 1e-8;

/// Weight of one hand of a shape: so that shapes count alike, the inverse of the share that holds, and this much at most.
const MOST_WEIGHT: f64 = 60.0;

/// Seeds of the first weights and of the batches: any will do.
const SEEDS: [u64; 2] = [0x4649_5253, 0x4241_5443];

/// Numbers that are taught: per unit its weights, its bias and its output; and one more.
const NUMBERS: usize = UNITS * (INPUTS + 2) + 1;
const BIASES: usize = UNITS * INPUTS;
const OUTPUTS: usize = BIASES + UNITS;
const OUTPUT_BIAS: usize = NUMBERS - 1;

/// An example as the network sees it.
struct Lesson {
    scaled: [f32; INPUTS],
    holds: bool,
    weight: f32,
}

/// A network that rates hands of these shapes.
pub(super) fn teach(by_shape: &[Vec<Example>]) -> Network {
    let mut network = untaught(by_shape);
    let mut lessons = lessons(by_shape, &network);
    let mut numbers = first_numbers();
    let mut memory = [vec![0.0_f32; NUMBERS], vec![0.0_f32; NUMBERS]];
    let steps = (EPOCHS * (lessons.len() / BATCH) as u64) as f64;
    let mut step = 0.0;
    for epoch in 0..EPOCHS {
        shuffle(&mut lessons, &mut AttemptStream::new(SEEDS[1], epoch));
        for batch in lessons.chunks_exact(BATCH) {
            write(&numbers, &mut network);
            let gradient = gradient(&network, &numbers, batch);
            step += 1.0;
            let rate = RATE * 0.5 * (1.0 + (PI * step / steps).cos());
            let unbiased = MEMORY.map(|memory| 1.0 - f64::from(memory).powf(step) as f32);
            for i in 0..NUMBERS {
                memory[0][i] += (1.0 - MEMORY[0]) * (gradient[i] - memory[0][i]);
                memory[1][i] += (1.0 - MEMORY[1]) * (gradient[i] * gradient[i] - memory[1][i]);
                let root = (memory[1][i] / unbiased[1]).sqrt() + LEAST_ROOT;
                numbers[i] -= rate as f32 * memory[0][i] / unbiased[0] / root;
            }
        }
    }
    write(&numbers, &mut network);
    network
}

/// A network that only knows what is usual of what it is told.
fn untaught(by_shape: &[Vec<Example>]) -> Network {
    let (means, scales) = spread(by_shape);
    Network {
        means,
        scales,
        weights: [[0.0; UNITS]; INPUTS],
        biases: [0.0; UNITS],
        outputs: [0.0; UNITS],
        output_bias: 0.0,
    }
}

/// Mean and inverse standard deviation of all that is told.
fn spread(by_shape: &[Vec<Example>]) -> ([f32; INPUTS], [f32; INPUTS]) {
    let count = by_shape.iter().map(Vec::len).sum::<usize>() as f64;
    let mean = |of: &dyn Fn(&Example) -> f64| by_shape.iter().flatten().map(of).sum::<f64>() / count;
    let means: [f64; INPUTS] = std::array::from_fn(|i| mean(&|example| f64::from(example.told[i])));
    let scales = std::array::from_fn(|i| {
        let variance = mean(&|example| (f64::from(example.told[i]) - means[i]).powi(2));
        variance.sqrt().max(1e-6).recip() as f32
    });
    (means.map(|mean| mean as f32), scales)
}

fn lessons(by_shape: &[Vec<Example>], network: &Network) -> Vec<Lesson> {
    let mut lessons = Vec::new();
    for examples in by_shape.iter().filter(|examples| !examples.is_empty()) {
        let held = examples.iter().filter(|example| example.holds).count();
        let weight = (examples.len() as f64 / (held as f64).max(1.0)).min(MOST_WEIGHT) as f32;
        lessons.extend(examples.iter().map(|example| Lesson {
            scaled: network.scaled(&example.told),
            holds: example.holds,
            weight,
        }));
    }
    let mean = lessons.iter().map(|lesson| lesson.weight).sum::<f32>() / lessons.len() as f32;
    for lesson in &mut lessons {
        lesson.weight /= mean;
    }
    lessons
}

/// Small weights, so that the units differ.
fn first_numbers() -> Vec<f32> {
    let mut stream = AttemptStream::new(SEEDS[0], 0);
    // He and others, 2015, with an even distribution.
    let [hidden, output] = [INPUTS, UNITS].map(|told| (6.0 / told as f32).sqrt());
    (0..NUMBERS)
        .map(|i| match i {
            ..BIASES => stream.between(-hidden, hidden),
            OUTPUTS..OUTPUT_BIAS => stream.between(-output, output),
            _ => 0.0,
        })
        .collect()
}

fn shuffle(lessons: &mut [Lesson], stream: &mut AttemptStream) {
    for i in (1..lessons.len()).rev() {
        lessons.swap(i, stream.below(i + 1));
    }
}

/// The mean gradient of a batch's loss, and of the weights' decay.
fn gradient(network: &Network, numbers: &[f32], batch: &[Lesson]) -> Vec<f32> {
    let mut gradient = vec![0.0_f32; NUMBERS];
    for lesson in batch {
        let units = network.units(&lesson.scaled);
        let weighted = units.iter().zip(&network.outputs);
        let log_odds = network.output_bias + weighted.map(|(unit, weight)| unit * weight).sum::<f32>();
        let chance = (1.0 + (-log_odds).exp()).recip();
        let error = (chance - f32::from(u8::from(lesson.holds))) * lesson.weight / batch.len() as f32;
        gradient[OUTPUT_BIAS] += error;
        let mut of_units = [0.0; UNITS];
        for unit in 0..UNITS {
            gradient[OUTPUTS + unit] += error * units[unit];
            if units[unit] > 0.0 {
                of_units[unit] = error * network.outputs[unit];
                gradient[BIASES + unit] += of_units[unit];
            }
        }
        for (told, of_weights) in lesson.scaled.iter().zip(gradient.chunks_exact_mut(UNITS)) {
            for (of_weight, of_unit) in of_weights.iter_mut().zip(&of_units) {
                *of_weight += told * of_unit;
            }
        }
    }
    for (i, number) in numbers.iter().enumerate() {
        if !(BIASES..OUTPUTS).contains(&i) && i != OUTPUT_BIAS {
            gradient[i] += DECAY * number;
        }
    }
    gradient
}

/// Writes the numbers into the network: per thing that is told the units' weights, then biases, outputs and the last bias.
fn write(numbers: &[f32], network: &mut Network) {
    for (row, weights) in network.weights.iter_mut().zip(numbers.chunks_exact(UNITS)) {
        row.copy_from_slice(weights);
    }
    network.biases.copy_from_slice(&numbers[BIASES..OUTPUTS]);
    network.outputs.copy_from_slice(&numbers[OUTPUTS..OUTPUT_BIAS]);
    network.output_bias = numbers[OUTPUT_BIAS];
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(stream: &mut AttemptStream) -> Example {
        let told: [f32; INPUTS] = std::array::from_fn(|_| stream.between(-1.0, 1.0));
        // A rule that no weighted sum follows.
        let holds = (told[3] - told[7]).abs() < 0.4;
        Example { told, holds }
    }

    fn examples(seed: u64, count: usize) -> Vec<Example> {
        let mut stream = AttemptStream::new(seed, 0);
        (0..count).map(|_| example(&mut stream)).collect()
    }

    /// By the formula, in double precision.
    fn loss(numbers: &[f64], batch: &[Lesson]) -> f64 {
        let of_lesson = |lesson: &Lesson| {
            let mut log_odds = numbers[OUTPUT_BIAS];
            for unit in 0..UNITS {
                let mut sum = numbers[BIASES + unit];
                for (i, told) in lesson.scaled.iter().enumerate() {
                    sum += f64::from(*told) * numbers[i * UNITS + unit];
                }
                log_odds += sum.max(0.0) * numbers[OUTPUTS + unit];
            }
            let wrong = if lesson.holds { -log_odds } else { log_odds };
            f64::from(lesson.weight) * wrong.exp().ln_1p()
        };
        let weights = numbers[..BIASES].iter().chain(&numbers[OUTPUTS..OUTPUT_BIAS]);
        let decay = weights.map(|weight| 0.5 * f64::from(DECAY) * weight * weight);
        batch.iter().map(of_lesson).sum::<f64>() / batch.len() as f64 + decay.sum::<f64>()
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        let by_shape = [examples(1, 40), examples(2, 40)];
        let mut network = untaught(&by_shape);
        let batch = lessons(&by_shape, &network);
        let numbers = first_numbers();
        write(&numbers, &mut network);
        let told = gradient(&network, &numbers, &batch);
        let numbers: Vec<f64> = numbers.into_iter().map(f64::from).collect();
        for (i, told) in told.iter().enumerate() {
            let step = 1e-7;
            let [more, less] = [step, -step].map(|step| {
                let mut moved = numbers.clone();
                moved[i] += step;
                loss(&moved, &batch)
            });
            let measured = (more - less) / (2.0 * step);
            assert!(
                (measured - f64::from(*told)).abs() < 1e-5,
                "{i}: {measured} and {told}"
            );
        }
    }

    #[test]
    fn what_is_taught_is_known_of_others() {
        let network = teach(&[examples(3, 30_000), examples(4, 30_000)]);
        let right = examples(5, 2000)
            .iter()
            .filter(|example| (network.log_odds(&example.told) > 0.0) == example.holds)
            .count();
        assert!(right > 1900, "{right} of 2000");
    }
}
