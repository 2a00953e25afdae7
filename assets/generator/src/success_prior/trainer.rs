//! Trains a network: logistic loss, Adam (Kingma and Ba, 2015) on small batches, a learning rate that falls to zero.

use std::f64::consts::PI;

use grasp_synthesis::{
    base::random::AttemptStream,
    propose::success_prior::{INPUTS, Network, UNITS},
};

use super::examples::Example;

/// Passes over all examples.
const EPOCHS: u64 = 12;

/// Examples per batch.
const BATCH: usize = 512;

/// Initial learning rate.
const RATE: f64 = 3e-3;

/// Weight decay.
const DECAY: f32 = 1e-4;

/// Decay rates of the running means of the gradient and its square, and the epsilon under the latter's root: as in the
/// paper.
const MEMORY: [f32; 2] = [0.9, 0.999];
const MIN_ROOT: f32 = 1e-8;

/// Largest weight of an example: it is the inverse of the share of its shape's hands that hold, which balances shapes.
const MAX_WEIGHT: f64 = 60.0;

/// Seeds of the first weights and of the batches: any will do.
const SEEDS: [u64; 2] = [0x4649_5253, 0x4241_5443];

/// Trained parameters: per unit its weights, its bias and its output weight; and the output bias.
const PARAMETERS: usize = UNITS * (INPUTS + 2) + 1;
const BIASES: usize = UNITS * INPUTS;
const OUTPUTS: usize = BIASES + UNITS;
const OUTPUT_BIAS: usize = PARAMETERS - 1;

/// An example with scaled features and its weight.
struct Sample {
    scaled: [f32; INPUTS],
    holds: bool,
    weight: f32,
}

/// A network trained on the examples of these shapes.
pub(super) fn train(by_shape: &[Vec<Example>]) -> Network {
    let mut network = untrained(by_shape);
    let mut samples = samples(by_shape, &network);
    let mut parameters = initial_parameters();
    let mut memory = [vec![0.0_f32; PARAMETERS], vec![0.0_f32; PARAMETERS]];
    let steps = (EPOCHS * (samples.len() / BATCH) as u64) as f64;
    let mut step = 0.0;
    for epoch in 0..EPOCHS {
        shuffle(&mut samples, &mut AttemptStream::new(SEEDS[1], epoch));
        for batch in samples.chunks_exact(BATCH) {
            write(&parameters, &mut network);
            let gradient = gradient(&network, &parameters, batch);
            step += 1.0;
            let rate = RATE * 0.5 * (1.0 + (PI * step / steps).cos());
            let unbiased = MEMORY.map(|memory| 1.0 - f64::from(memory).powf(step) as f32);
            for i in 0..PARAMETERS {
                memory[0][i] += (1.0 - MEMORY[0]) * (gradient[i] - memory[0][i]);
                memory[1][i] += (1.0 - MEMORY[1]) * (gradient[i] * gradient[i] - memory[1][i]);
                let root = (memory[1][i] / unbiased[1]).sqrt() + MIN_ROOT;
                parameters[i] -= rate as f32 * memory[0][i] / unbiased[0] / root;
            }
        }
    }
    write(&parameters, &mut network);
    network
}

/// A network with nothing but the scaling of its input.
fn untrained(by_shape: &[Vec<Example>]) -> Network {
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

/// Mean and inverse standard deviation of every feature.
fn spread(by_shape: &[Vec<Example>]) -> ([f32; INPUTS], [f32; INPUTS]) {
    let count = by_shape.iter().map(Vec::len).sum::<usize>() as f64;
    let mean = |of: &dyn Fn(&Example) -> f64| by_shape.iter().flatten().map(of).sum::<f64>() / count;
    let means: [f64; INPUTS] = std::array::from_fn(|i| mean(&|example| f64::from(example.features[i])));
    let scales = std::array::from_fn(|i| {
        let variance = mean(&|example| (f64::from(example.features[i]) - means[i]).powi(2));
        variance.sqrt().max(1e-6).recip() as f32
    });
    (means.map(|mean| mean as f32), scales)
}

fn samples(by_shape: &[Vec<Example>], network: &Network) -> Vec<Sample> {
    let mut samples = Vec::new();
    for examples in by_shape.iter().filter(|examples| !examples.is_empty()) {
        let held = examples.iter().filter(|example| example.holds).count();
        let weight = (examples.len() as f64 / (held as f64).max(1.0)).min(MAX_WEIGHT) as f32;
        samples.extend(examples.iter().map(|example| Sample {
            scaled: network.scaled(&example.features),
            holds: example.holds,
            weight,
        }));
    }
    let mean = samples.iter().map(|sample| sample.weight).sum::<f32>() / samples.len() as f32;
    for sample in &mut samples {
        sample.weight /= mean;
    }
    samples
}

/// Small random weights, so that the units differ.
fn initial_parameters() -> Vec<f32> {
    let mut stream = AttemptStream::new(SEEDS[0], 0);
    // He et al., 2015, with a uniform distribution.
    let [hidden, output] = [INPUTS, UNITS].map(|inputs| (6.0 / inputs as f32).sqrt());
    (0..PARAMETERS)
        .map(|i| match i {
            ..BIASES => stream.between(-hidden, hidden),
            OUTPUTS..OUTPUT_BIAS => stream.between(-output, output),
            _ => 0.0,
        })
        .collect()
}

fn shuffle(samples: &mut [Sample], stream: &mut AttemptStream) {
    for i in (1..samples.len()).rev() {
        samples.swap(i, stream.below(i + 1));
    }
}

/// The mean gradient of a batch's loss and of the weight decay.
fn gradient(network: &Network, parameters: &[f32], batch: &[Sample]) -> Vec<f32> {
    let mut gradient = vec![0.0_f32; PARAMETERS];
    for sample in batch {
        let units = network.units(&sample.scaled);
        let weighted = units.iter().zip(&network.outputs);
        let log_odds = network.output_bias + weighted.map(|(unit, weight)| unit * weight).sum::<f32>();
        let chance = (1.0 + (-log_odds).exp()).recip();
        let error = (chance - f32::from(u8::from(sample.holds))) * sample.weight / batch.len() as f32;
        gradient[OUTPUT_BIAS] += error;
        let mut of_units = [0.0; UNITS];
        for unit in 0..UNITS {
            gradient[OUTPUTS + unit] += error * units[unit];
            if units[unit] > 0.0 {
                of_units[unit] = error * network.outputs[unit];
                gradient[BIASES + unit] += of_units[unit];
            }
        }
        for (feature, of_weights) in sample.scaled.iter().zip(gradient.chunks_exact_mut(UNITS)) {
            for (of_weight, of_unit) in of_weights.iter_mut().zip(&of_units) {
                *of_weight += feature * of_unit;
            }
        }
    }
    for (i, number) in parameters.iter().enumerate() {
        if !(BIASES..OUTPUTS).contains(&i) && i != OUTPUT_BIAS {
            gradient[i] += DECAY * number;
        }
    }
    gradient
}

/// Writes the parameters into the network: per feature the units' weights, then biases, output weights and output bias.
fn write(parameters: &[f32], network: &mut Network) {
    for (row, weights) in network.weights.iter_mut().zip(parameters.chunks_exact(UNITS)) {
        row.copy_from_slice(weights);
    }
    network.biases.copy_from_slice(&parameters[BIASES..OUTPUTS]);
    network.outputs.copy_from_slice(&parameters[OUTPUTS..OUTPUT_BIAS]);
    network.output_bias = parameters[OUTPUT_BIAS];
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(stream: &mut AttemptStream) -> Example {
        let features: [f32; INPUTS] = std::array::from_fn(|_| stream.between(-1.0, 1.0));
        // A rule that no weighted sum follows.
        let holds = (features[3] - features[7]).abs() < 0.4;
        Example { features, holds }
    }

    fn examples(seed: u64, count: usize) -> Vec<Example> {
        let mut stream = AttemptStream::new(seed, 0);
        (0..count).map(|_| example(&mut stream)).collect()
    }

    /// By the formula, in double precision.
    fn loss(parameters: &[f64], batch: &[Sample]) -> f64 {
        let of_sample = |sample: &Sample| {
            let mut log_odds = parameters[OUTPUT_BIAS];
            for unit in 0..UNITS {
                let mut sum = parameters[BIASES + unit];
                for (i, feature) in sample.scaled.iter().enumerate() {
                    sum += f64::from(*feature) * parameters[i * UNITS + unit];
                }
                log_odds += sum.max(0.0) * parameters[OUTPUTS + unit];
            }
            let wrong = if sample.holds { -log_odds } else { log_odds };
            f64::from(sample.weight) * wrong.exp().ln_1p()
        };
        let weights = parameters[..BIASES]
            .iter()
            .chain(&parameters[OUTPUTS..OUTPUT_BIAS]);
        let decay = weights.map(|weight| 0.5 * f64::from(DECAY) * weight * weight);
        batch.iter().map(of_sample).sum::<f64>() / batch.len() as f64 + decay.sum::<f64>()
    }

    #[test]
    fn gradient_matches_finite_differences() {
        let by_shape = [examples(1, 40), examples(2, 40)];
        let mut network = untrained(&by_shape);
        let batch = samples(&by_shape, &network);
        let parameters = initial_parameters();
        write(&parameters, &mut network);
        let analytic = gradient(&network, &parameters, &batch);
        let parameters: Vec<f64> = parameters.into_iter().map(f64::from).collect();
        for (i, analytic) in analytic.iter().enumerate() {
            let step = 1e-7;
            let [more, less] = [step, -step].map(|step| {
                let mut moved = parameters.clone();
                moved[i] += step;
                loss(&moved, &batch)
            });
            let measured = (more - less) / (2.0 * step);
            assert!(
                (measured - f64::from(*analytic)).abs() < 1e-5,
                "{i}: {measured} and {analytic}"
            );
        }
    }

    #[test]
    fn trained_network_generalises() {
        let network = train(&[examples(3, 30_000), examples(4, 30_000)]);
        let right = examples(5, 2000)
            .iter()
            .filter(|example| (network.log_odds(&example.features) > 0.0) == example.holds)
            .count();
        assert!(right > 1900, "{right} of 2000");
    }
}
