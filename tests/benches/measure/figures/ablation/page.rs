//! The results as CSV for scripts and as a page for readers.

use std::fmt::Write as _;

use grasp_experiment::machine::Machine;
use grasp_synthesis::base::mechanisms::Mechanism;

use super::{
    Knowledge, shown,
    summary::{ANSWERED_COST, Comparison, Figure, MEDIAN_COST, P99_COST, Results, VariantStats},
};
use crate::figures::setting::Setting;

/// One line per class and variant.
pub(super) fn csv(all: &[Results]) -> String {
    let mut text = String::from(
        "row,class,without,searches,median_us,p90_us,p99_us,mean_us,wall_median_us,answered_percent,mean_score,\
         median_ratio,median_ratio_low,median_ratio_high,p99_ratio,p99_ratio_low,p99_ratio_high,\
         answered_points,answered_points_low,answered_points_high,\
         mean_ratio,mean_ratio_low,mean_ratio_high,\
         wall_median_ratio,wall_median_ratio_low,wall_median_ratio_high,score_ratio\n",
    );
    for results in all {
        let searches = results.all_on().count() / 2;
        for (number, (off, own, against)) in results.variants.iter().enumerate() {
            let without = match (off, number) {
                (Some(mechanism), _) => mechanism.name(),
                (None, 0) => "nothing (A)",
                (None, _) => "nothing (B)",
            };
            let VariantStats {
                median,
                p90,
                p99,
                mean,
                wall_median,
                answered,
                score,
            } = own;
            let (row, class) = (results.knowledge.name(), results.class.name());
            let _ = write!(text, "{row},{class},{without},{searches}");
            for seconds in [median, p90, p99, mean, wall_median] {
                let _ = write!(text, ",{:.2}", seconds * 1e6);
            }
            let _ = write!(text, ",{:.3},{score:.4}", 100.0 * answered);
            for Figure { value, low, high } in [
                against.median,
                against.p99,
                against.answered,
                against.mean,
                against.wall_median,
            ] {
                let _ = write!(text, ",{value:.4},{low:.4},{high:.4}");
            }
            let _ = writeln!(text, ",{:.4}", against.score);
        }
    }
    text
}

/// The rule, the results with all mechanisms on, the noise, one table per kind of knowledge, and the verdicts.
pub(super) fn page(all: &[Results], setting: &Setting, loads: &[Option<String>; 2]) -> String {
    let load = |load: &Option<String>| load.clone().unwrap_or_else(|| "unknown".to_owned());
    let searches = all.first().map_or(0, |results| results.all_on().count() / 2);
    let mut text = format!(
        "# What each mechanism of a default search contributes\n\n\
         Made by `cargo bench -p grasp-tests --bench measure -- figures --only ablation --holdouts {searches} --givers {}`; \
         every figure is in `ablation.csv`.\n\n\
         {}; load average {} before and {} after. {searches} searches per class and variant, {} givers per object, \
         50 ms per search, two workers. Each holdout is searched by every variant in turn, in shuffled order and with \
         the same seed. Times and the 50 ms are processor time, the duration on an idle machine: all of a thread that works \
         alone, and half of what two workers take together; *wall* is the median wall time, including other load on the \
         machine. *warm*: with complete atlases; *cold*: without an atlas. Learned grips are not measured: no request repeats \
         here.\n\n\
         **Rule.** A mechanism is removed if its absence costs less than {:.0} % at the median (on either clock), less than {:.0} % at p99 \
         and less than {ANSWERED_COST} percentage points of answers in 50 ms with every class of holdouts. A verdict is \
         *sure* if the whole 95 % intervals (bootstrap over holdouts) agree with it.\n\n",
        setting.givers,
        Machine::this(),
        load(&loads[0]),
        load(&loads[1]),
        setting.givers,
        100.0 * MEDIAN_COST,
        100.0 * P99_COST,
    );
    text += "## All mechanisms on, and noise\n\n\
             The last five columns compare two identical runs.\n\n\
             | row | class | median | p90 | p99 | mean | answered in 50 ms | score | median | wall | p99 | answered | mean |\n\
             |---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n";
    for results in all {
        let (own, noise) = (results.baseline(), results.noise());
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {:.2} % | {:.3} | {} | {} | {} | {} | {} |",
            results.knowledge.name(),
            results.class.name(),
            shown(own.median),
            shown(own.p90),
            shown(own.p99),
            shown(own.mean),
            100.0 * own.answered,
            own.score,
            ratio(noise.median),
            ratio(noise.wall_median),
            ratio(noise.p99),
            points(noise.answered),
            ratio(noise.mean),
        );
    }
    for knowledge in Knowledge::ALL {
        text += &table(all, knowledge);
    }
    text + &verdicts(all)
}

fn ratio(figure: Figure) -> String {
    format!("{:.2} ({:.2}–{:.2})", figure.value, figure.low, figure.high)
}

fn points(figure: Figure) -> String {
    format!("{:+.2} ({:+.2} to {:+.2})", figure.value, figure.low, figure.high)
}

/// Each mechanism off against all on: one line per mechanism, columns per class.
fn table(all: &[Results], knowledge: Knowledge) -> String {
    let classes: Vec<&Results> = all
        .iter()
        .filter(|results| results.knowledge == knowledge)
        .collect();
    let mut text = format!(
        "\n## {}\n\nRatios to all on, with 95 % intervals; answers within 50 ms in percentage points. Bold: beyond the rule's \
         limit.\n\n| without |",
        knowledge.name()
    );
    for results in &classes {
        let class = results.class.name();
        let _ = write!(text, " {class}: median | wall | p99 | answered | mean | score |");
    }
    text += "\n|---|";
    text += &"---:|---:|---:|---:|---:|---:|".repeat(classes.len());
    text.push('\n');
    for mechanism in knowledge.mechanisms() {
        let _ = write!(text, "| {mechanism} |");
        for results in &classes {
            let Some(against) = of(results, mechanism) else {
                text += " | | | | | |";
                continue;
            };
            let marked = |cell: String, is_beyond: bool| if is_beyond { format!("**{cell}**") } else { cell };
            let _ = write!(
                text,
                " {} | {} | {} | {} | {} | {:.3} |",
                marked(ratio(against.median), against.median.value >= 1.0 + MEDIAN_COST),
                marked(
                    ratio(against.wall_median),
                    against.wall_median.value >= 1.0 + MEDIAN_COST
                ),
                marked(ratio(against.p99), against.p99.value >= 1.0 + P99_COST),
                marked(points(against.answered), against.answered.value <= -ANSWERED_COST),
                ratio(against.mean),
                against.score,
            );
        }
        text.push('\n');
    }
    text
}

fn of(results: &Results, mechanism: Mechanism) -> Option<Comparison> {
    let mut variants = results.variants.iter();
    let found = variants.find(|(off, ..)| *off == Some(mechanism));
    found.map(|(_, _, against)| *against)
}

/// The rule's verdict on each measured mechanism.
fn verdicts(all: &[Results]) -> String {
    let mut text = String::from(
        "\n## Verdicts\n\nThe highest cost of a mechanism's absence over all classes.\n\n\
         | mechanism | median | wall | p99 | answered in 50 ms | least score | verdict |\n|---|---:|---:|---:|---:|---:|---|\n",
    );
    for mechanism in Mechanism::ALL {
        let measured: Vec<(String, Comparison)> = all
            .iter()
            .filter_map(|results| {
                let class = format!("{}, {}", results.knowledge.name(), results.class.name());
                Some((class, of(results, mechanism)?))
            })
            .collect();
        if measured.is_empty() {
            let _ = writeln!(text, "| {mechanism} | | | | | | not measured |");
            continue;
        }
        let worst = |value: fn(&Comparison) -> f64| {
            let worst = measured
                .iter()
                .max_by(|(_, a), (_, b)| value(a).total_cmp(&value(b)));
            worst.expect("at least one class was measured")
        };
        let (median_class, median) = worst(|against| against.median.value);
        let (wall_class, wall) = worst(|against| against.wall_median.value);
        let (p99_class, p99) = worst(|against| against.p99.value);
        let (answered_class, answered) = worst(|against| -against.answered.value);
        let (_, score) = worst(|against| -against.score);
        let costs = |against: &Comparison, of: fn(&Figure) -> f64, of_answered: fn(&Figure) -> f64| {
            of(&against.median).max(of(&against.wall_median)) >= 1.0 + MEDIAN_COST
                || of(&against.p99) >= 1.0 + P99_COST
                || of_answered(&against.answered) <= -ANSWERED_COST
        };
        let any = |of: fn(&Figure) -> f64, of_answered: fn(&Figure) -> f64| {
            measured
                .iter()
                .any(|(_, against)| costs(against, of, of_answered))
        };
        let is_kept = any(|figure| figure.value, |figure| figure.value);
        let is_surely_kept = any(|figure| figure.low, |figure| figure.high);
        let may_be_kept = any(|figure| figure.high, |figure| figure.low);
        let verdict = match (is_kept, is_surely_kept, may_be_kept) {
            (true, true, _) => "keep, sure",
            (true, false, _) => "keep",
            (false, _, true) => "**remove**",
            (false, _, false) => "**remove, sure**",
        };
        let _ = writeln!(
            text,
            "| {mechanism} | {} ({median_class}) | {} ({wall_class}) | {} ({p99_class}) | {} ({answered_class}) | {:.3} | {verdict} |",
            ratio(median.median),
            ratio(wall.wall_median),
            ratio(p99.p99),
            points(answered.answered),
            score.score,
        );
    }
    text
}
