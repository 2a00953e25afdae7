//! The table of what was baked.

use std::path::Path;

use grasp_client::v1::{Atlas, AtlasGrowth, GraspObject};
use serde::Serialize;

use super::{densities::Density, reasons::of_growth};
use crate::{format::joined, output::table};

/// What became of a mesh.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Row {
    /// "objects/{object}".
    pub name: String,
    /// The file's name.
    pub mesh: String,
    /// True if this run created it.
    pub created: bool,
    /// Its mass in kilograms; `None` if it was rejected.
    pub mass_kg: Option<f32>,
    /// The density that its mass was computed with; `None` if a manifest has the mass.
    pub density: Option<Density>,
    /// Number of triangles; `None` if it was rejected.
    pub triangles: Option<u32>,
    /// The atlases of the right and of the left hand; `None` on a server without atlases.
    pub grips: Option<[Grips; 2]>,
    /// True if the atlases ceased to grow before they were complete.
    pub stalled: bool,
    /// Why atlases do not grow, as far as the server says.
    pub growth: Option<String>,
    /// What test givers showed.
    pub givers: Givers,
    /// If it got no grips or was taken from no giver: what keeps hands from the object alone; `None` if they can hold it.
    pub in_the_way: Option<String>,
    /// Oddities of the mesh.
    pub warnings: Vec<String>,
    /// Why it was rejected.
    pub error: Option<String>,
}

/// The state of one hand's atlas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub(super) struct Grips {
    /// Number of grips.
    pub entries: u32,
    /// True if it does not grow any more.
    pub complete: bool,
}

/// From how many test givers an object was taken.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Givers {
    /// Givers for whom a hold was searched.
    pub requested: u16,
    /// Givers that found a hold.
    pub tried: u16,
    /// Those of them that it was taken from.
    pub answered: u16,
    /// Why it was not taken from the last of the others.
    pub last_failure: Option<String>,
}

impl Row {
    /// Of a mesh that is to be registered.
    pub(super) fn new(id: &str, mesh: &Path) -> Self {
        let file = mesh.file_name().unwrap_or_default();
        Self {
            name: format!("objects/{id}"),
            mesh: file.to_string_lossy().into_owned(),
            ..Self::default()
        }
    }

    /// True if a hand got no grips, or it was taken from no test giver.
    pub(super) fn is_out_of_reach(&self) -> bool {
        self.lacks_grips() || (self.givers.requested > 0 && self.givers.answered == 0)
    }

    /// True if the server keeps atlases, and a hand has no grips.
    fn lacks_grips(&self) -> bool {
        let is_lacking = |grips: [Grips; 2]| grips.iter().any(|hand| hand.entries == 0);
        self.grips.is_some_and(is_lacking)
    }

    /// What is odd about it, and why it has no more grips or givers.
    fn notes(&self) -> String {
        let Givers {
            requested,
            tried,
            answered,
            ref last_failure,
        } = self.givers;
        let has_ceased = self.stalled || self.lacks_grips();
        let growth = self.growth.as_ref().filter(|_| has_ceased);
        let failure = last_failure.as_ref().filter(|_| answered < tried);
        let notes = [
            self.error.clone(),
            growth.map(|why| format!("its atlases do not grow: {why}")),
            self.in_the_way.clone(),
            (tried < requested).then(|| format!("{} givers found no hold of it", requested - tried)),
            failure.map(|why| format!("not taken from {} givers, the last: {why}", tried - answered)),
        ];
        joined("; ", notes.into_iter().flatten().chain(self.warnings.clone()))
    }

    /// Takes over what the server says of the object, and of its atlases for the right and the left hand.
    pub(super) fn describe(&mut self, object: &GraspObject, atlases: &[Atlas; 2]) {
        self.mass_kg = Some(object.mass_kg);
        self.triangles = Some(object.triangle_count);
        self.warnings.clone_from(&object.warnings);
        self.growth = of_growth(atlases);
        let is_kept = |atlas: &Atlas| atlas.growth != 0 || atlas.entry_count > 0;
        let grips = |atlas: &Atlas| Grips {
            entries: atlas.entry_count,
            complete: matches!(atlas.growth(), AtlasGrowth::Complete | AtlasGrowth::NothingFound),
        };
        let are_kept = atlases.iter().any(is_kept);
        self.grips = are_kept.then(|| atlases.each_ref().map(grips));
    }
}

/// The table, for people.
pub(super) fn describe(rows: &[Row]) -> String {
    let mut all = table("object |  | >mass | density | >triangles | >grips r + l | >givers | notes");
    for row in rows {
        let state = match (&row.error, row.created) {
            (Some(_), _) => "rejected",
            (None, true) => "new",
            (None, false) => "",
        };
        let mass = row.mass_kg.map(|mass| format!("{:.0} g", 1000.0 * mass));
        let density = row.density.as_ref().map(|density| {
            let material = density.material.unwrap_or("by default");
            format!("{:.0} kg/m³, {material}", density.kg_per_m3)
        });
        let triangles = row.triangles.map(|count| count.to_string());
        let entries = row.grips.map(|grips| grips.map(|hand| hand.entries));
        let grips = entries.map(|[right, left]| format!("{right} + {left}"));
        let (requested, answered) = (row.givers.requested, row.givers.answered);
        let givers = (requested > 0).then(|| format!("{answered} of {requested}"));
        all.add_row([
            row.name.clone(),
            state.to_owned(),
            mass.unwrap_or_default(),
            density.unwrap_or_default(),
            triangles.unwrap_or_default(),
            grips.unwrap_or_default(),
            givers.unwrap_or_default(),
            row.notes(),
        ]);
    }
    all.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_say_mass_density_grips_and_why_not() {
        let grips = |entries| Grips {
            entries,
            complete: true,
        };
        let row = Row {
            created: true,
            mass_kg: Some(0.35),
            density: Some(Density {
                material: None,
                kg_per_m3: 400.0,
            }),
            triangles: Some(1984),
            grips: Some([grips(2048), grips(1990)]),
            givers: Givers {
                requested: 12,
                tried: 11,
                answered: 10,
                last_failure: Some("limited by the giver".to_owned()),
            },
            ..Row::new("mug", Path::new("a/Mug.obj"))
        };
        let mut wrong = Row::new("bolt", Path::new("bolt.stl"));
        wrong.error = Some("mesh: has no triangles".to_owned());
        let text = describe(&[row, wrong]);
        for part in [
            "350 g",
            "400 kg/m³, by default",
            "2048 + 1990",
            "10 of 12",
            "1 givers found no hold",
            "not taken from 1 givers, the last: limited by the giver",
            "rejected",
            "has no triangles",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }
}
