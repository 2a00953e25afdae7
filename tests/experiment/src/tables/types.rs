//! Grasp types of the taxonomy (2.4, 6.1).

use grasp_synthesis::model::grasp_type::GraspType;

use crate::{
    table::{Table, Value},
    types::SetTypes,
};

/// The share of grasps without a type, by set.
pub fn unclassifiable(types: &[SetTypes]) -> Table {
    let mut table = Table::new(
        "unclassifiable",
        "Valid grasps that are of no type of the taxonomy",
        [
            "set",
            "grasps",
            "different ones",
            "unclassifiable, %",
            "±",
            "types that occur",
        ],
    );
    for set in types.iter().filter(|set| set.count() > 0) {
        let occur = GraspType::ALL.into_iter().filter(|&of| occurs(set, of)).count();
        table.push(vec![
            set.set.name().into(),
            (set.count() as u64).into(),
            set.different.into(),
            Value::decimals(set.share(None).map(|share| 100.0 * share), 1),
            Value::decimals(set.margin().map(|margin| 100.0 * margin), 1),
            (occur as u64).into(),
        ]);
    }
    table
}

/// The share of each type that occurs, by set.
pub fn grasp_types(types: &[SetTypes]) -> Table {
    let mut header = vec!["number".to_owned(), "type".to_owned()];
    header.extend(types.iter().map(|set| format!("{}, %", set.set.name())));
    let mut table = Table::new("grasp-types", "Types of valid grasps by set", header);
    let shares = |of| types.iter().map(move |set| percent(set, of));
    for of in GraspType::ALL {
        if types.iter().any(|set| occurs(set, of)) {
            let mut row = vec![u64::from(of.number()).into(), of.name().into()];
            row.extend(shares(Some(of)));
            table.push(row);
        }
    }
    if types.iter().any(|set| set.count() > 0) {
        let mut row = vec![Value::Missing, "unclassifiable".into()];
        row.extend(shares(None));
        table.push(row);
    }
    table
}

fn percent(set: &SetTypes, of: Option<GraspType>) -> Value {
    Value::decimals(set.share(of).map(|share| 100.0 * share), 1)
}

fn occurs(set: &SetTypes, of: GraspType) -> bool {
    set.by_holdout.iter().flatten().any(|&found| found == Some(of))
}
