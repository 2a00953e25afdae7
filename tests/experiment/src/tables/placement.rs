//! The measures of wrist placements (Figures 5.9 to 5.11, 5.13; Table 5.3) and the yaw angles (Figure 5.15).

use grasp_assets::hands::hand;
use grasp_synthesis::{
    model::{
        hand::{Digit, Handedness},
        strategy::Strategy,
    },
    thesis::placement_measures::{
        FORWARD_WRIST_ANGLE_DEGREES, MeasureRange, PALM_COM_PALM_ANGLE_DEGREES, PALM_DISTANCE,
        UPWARD_WRIST_ANGLE_DEGREES, WRIST_ANGLE_SUM_DEGREES, WRIST_DISTANCE,
    },
};

use crate::{
    data::Data,
    plan::{Set, THESIS_RIG},
    record::Measures,
    stats::{distance_from_uniform, quantile},
    table::{Table, Value},
};

/// Width of a bin of Figure 5.13, in degrees.
pub(crate) const PALM_ANGLE_BIN_DEGREES: f64 = 10.0;

/// A named measure with its range in Table 5.3, in centimetres and degrees.
pub(crate) struct Measure {
    pub(crate) name: &'static str,
    pub(crate) of: fn(&Measures) -> Option<f64>,
    pub(crate) allowed: MeasureRange,
}

impl Measure {
    /// The name without the unit.
    pub(crate) fn bare_name(&self) -> &'static str {
        self.name.split(',').next().unwrap_or(self.name)
    }
}

const fn in_centimetres(range: MeasureRange) -> MeasureRange {
    MeasureRange {
        min: range.min * 100.0,
        max: range.max * 100.0,
    }
}

/// The six measures.
pub(crate) const MEASURES: [Measure; 6] = [
    Measure {
        name: "wrist distance, cm",
        of: |measures| Some(f64::from(measures.wrist_distance_cm)),
        allowed: in_centimetres(WRIST_DISTANCE),
    },
    Measure {
        name: "palm distance, cm",
        of: |measures| Some(f64::from(measures.palm_distance_cm)),
        allowed: in_centimetres(PALM_DISTANCE),
    },
    Measure {
        name: "upwards wrist angle, °",
        of: |measures| Some(f64::from(measures.upward_degrees)),
        allowed: UPWARD_WRIST_ANGLE_DEGREES,
    },
    Measure {
        name: "forward wrist angle, °",
        of: |measures| Some(f64::from(measures.forward_degrees)),
        allowed: FORWARD_WRIST_ANGLE_DEGREES,
    },
    Measure {
        name: "wrist angle sum, °",
        of: |measures| Some(f64::from(measures.upward_degrees) + f64::from(measures.forward_degrees)),
        allowed: WRIST_ANGLE_SUM_DEGREES,
    },
    Measure {
        name: "palm-CoM-palm angle, °",
        of: |measures| measures.palm_com_palm_degrees.map(f64::from),
        allowed: PALM_COM_PALM_ANGLE_DEGREES,
    },
];

/// The values of a measure in a positive set.
pub(crate) fn valid_values(data: &Data<'_>, set: Set, measure: &Measure) -> Vec<f64> {
    let details = data.valid(set).filter_map(|record| record.details.as_ref());
    details
        .filter_map(|details| (measure.of)(details.measures.as_ref()?))
        .collect()
}

/// Share of the values within Table 5.3.
pub(crate) fn share_in_range(values: &[f64], allowed: MeasureRange) -> Option<f64> {
    // Recorded measures are rounded; a value on the boundary counts.
    const SLACK: f64 = 1e-3;
    let is_in =
        |value: &&f64| **value >= f64::from(allowed.min) - SLACK && **value <= f64::from(allowed.max) + SLACK;
    (!values.is_empty()).then(|| values.iter().filter(is_in).count() as f64 / values.len() as f64)
}

/// Measures of valid grasps, next to Table 5.3.
pub fn measure_ranges(data: &Data<'_>) -> Table {
    let header = [
        "set",
        "measure",
        "valid: smallest",
        "5 % below",
        "median",
        "95 % below",
        "valid: largest",
        "Table 5.3: from",
        "to",
        "% of valid in there",
    ];
    let mut table = Table::new("measures", "Measures of the placements of valid grasps", header);
    for strategy in [Strategy::A, Strategy::B] {
        for measure in &MEASURES {
            let values = valid_values(data, Set::ladder(strategy), measure);
            if values.is_empty() {
                continue;
            }
            let mut row = vec![Value::from(Set::ladder(strategy).name()), measure.name.into()];
            row.extend([0.0, 0.05, 0.5, 0.95, 1.0].map(|share| Value::number(quantile(&values, share))));
            row.push(Value::number(f64::from(measure.allowed.min)));
            row.push(Value::number(f64::from(measure.allowed.max)));
            let share = share_in_range(&values, measure.allowed);
            row.push(Value::decimals(share.map(|share| 100.0 * share), 1));
            table.push(row);
        }
    }
    table
}

/// Figure 5.13: valid grasps of set B by palm-CoM-palm angle.
pub fn palm_angle_bins(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "palm-com-palm",
        "Palm-CoM-palm angles of the positive grasp set B",
        ["from, °", "to, °", "grasps"],
    );
    for (bin, count) in palm_angle_counts(data).into_iter().enumerate() {
        let from = PALM_ANGLE_BIN_DEGREES * bin as f64;
        table.push(vec![
            Value::decimals(from, 0),
            Value::decimals(from + PALM_ANGLE_BIN_DEGREES, 0),
            count.into(),
        ]);
    }
    table
}

/// The counts of Figure 5.13, bin by bin from 0°.
pub(crate) fn palm_angle_counts(data: &Data<'_>) -> Vec<u64> {
    let values = valid_values(data, Set::ladder(Strategy::B), &MEASURES[5]);
    let bins = (180.0 / PALM_ANGLE_BIN_DEGREES) as usize;
    let mut counts = vec![0; bins];
    for value in values {
        counts[((value / PALM_ANGLE_BIN_DEGREES) as usize).min(bins - 1)] += 1;
    }
    counts
}

/// How evenly the yaw angles of touching digits are spread over their range in the positive set D.
pub fn yaw_spread(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "yaw",
        "Yaw angles of touching digits in the positive grasp set D",
        [
            "digit",
            "touching",
            "smallest, °",
            "median, °",
            "largest, °",
            "largest distance from an even spread, %",
            "by chance below (95 %), %",
        ],
    );
    for digit in Digit::ALL {
        let yaws = touching_yaws(data, digit);
        // Quantile of the Kolmogorov distribution, for some 35 values or more.
        let by_chance = 1.36 / (yaws.len() as f64).sqrt();
        let distance = yaw_distance(data, digit);
        table.push(vec![
            format!("{digit:?}").into(),
            (yaws.len() as u64).into(),
            Value::number(quantile(&yaws, 0.0)),
            Value::number(quantile(&yaws, 0.5)),
            Value::number(quantile(&yaws, 1.0)),
            Value::decimals(distance.map(|distance| 100.0 * distance), 1),
            Value::decimals(100.0 * by_chance, 1),
        ]);
    }
    table
}

/// The Kolmogorov-Smirnov distance of those angles from an even spread over the digit's range.
pub(crate) fn yaw_distance(data: &Data<'_>, digit: Digit) -> Option<f64> {
    let range = hand(THESIS_RIG, Handedness::Right)?
        .rig
        .digit(digit)
        .limits
        .base_yaw;
    let [min, max] = [range.min, range.max].map(|angle| f64::from(angle.to_degrees()));
    distance_from_uniform(&touching_yaws(data, digit), min, max)
}

/// Yaw angles of a touching digit in the positive set D, in degrees.
pub(crate) fn touching_yaws(data: &Data<'_>, digit: Digit) -> Vec<f64> {
    let details = data
        .valid(Set::ladder(Strategy::D))
        .filter_map(|record| record.details.as_ref());
    let posed = details.filter_map(|details| details.digits.get(digit.index()));
    posed
        .filter(|posed| posed.contacts > 0)
        .map(|posed| f64::from(posed.yaw_degrees))
        .collect()
}
