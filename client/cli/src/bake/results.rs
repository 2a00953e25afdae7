//! The table of what was baked.

use std::path::Path;

use grasp_client::v1::{Atlas, AtlasGrowth, GraspObject};
use serde::Serialize;

use super::{densities::Density, reasons::of_growth};
use crate::{
    failure::Failure,
    output::{Output, table},
};

/// What became of a mesh.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    /// "objects/{object}".
    pub name: String,
    /// The file's name.
    pub mesh: String,
    /// True if this run created it.
    pub created: bool,
    /// Its mass in kilograms; none if it was rejected.
    pub mass_kg: Option<f32>,
    /// The density that its mass was computed with; none if a manifest has the mass.
    pub density: Option<Density>,
    /// Number of triangles; none if it was rejected.
    pub triangles: Option<u32>,
    /// The atlases of the right and of the left hand; none on a server without atlases.
    pub grips: Option<[Grips; 2]>,
    /// True if the atlases ceased to grow before they were complete.
    pub stalled: bool,
    /// Why atlases do not grow, as far as the server says.
    pub growth: Option<String>,
    /// What test givers showed.
    pub givers: Givers,
    /// If it got no grips or was taken from no giver: what keeps hands from the object alone; none if they can hold it.
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
        Self {
            name: format!("objects/{id}"),
            mesh: mesh
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            created: false,
            mass_kg: None,
            density: None,
            triangles: None,
            grips: None,
            stalled: false,
            growth: None,
            givers: Givers::default(),
            in_the_way: None,
            warnings: Vec::new(),
            error: None,
        }
    }

    /// True if a hand got no grips, or it was taken from no test giver.
    pub(super) fn is_out_of_reach(&self) -> bool {
        self.lacks_grips() || (self.givers.requested > 0 && self.givers.answered == 0)
    }

    /// True if the server keeps atlases, and a hand has no grips.
    fn lacks_grips(&self) -> bool {
        self.grips
            .is_some_and(|grips| grips.iter().any(|hand| hand.entries == 0))
    }

    /// What is odd about it, and why it has no more grips or givers.
    fn notes(&self) -> String {
        let growth = self
            .growth
            .as_ref()
            .filter(|_| self.stalled || self.lacks_grips());
        let Givers {
            requested,
            tried,
            answered,
            ref last_failure,
        } = self.givers;
        let without_hold =
            (tried < requested).then(|| format!("{} givers found no hold of it", requested - tried));
        let failure = last_failure.as_ref().filter(|_| answered < tried);
        let failure =
            failure.map(|why| format!("not taken from {} givers, the last: {why}", tried - answered));
        let growth = growth.map(|why| format!("its atlases do not grow: {why}"));
        let notes = self
            .error
            .iter()
            .cloned()
            .chain(growth)
            .chain(self.in_the_way.clone());
        let notes = notes.chain(without_hold).chain(failure);
        notes
            .chain(self.warnings.iter().cloned())
            .collect::<Vec<_>>()
            .join("; ")
    }

    /// Takes over what the server says of the object, and of its atlases for the right and the left hand.
    pub(super) fn describe(&mut self, object: &GraspObject, atlases: &[Atlas; 2]) {
        self.mass_kg = Some(object.mass_kg);
        self.triangles = Some(object.triangle_count);
        self.warnings.clone_from(&object.warnings);
        self.growth = of_growth(atlases);
        let are_kept = atlases
            .iter()
            .any(|atlas| atlas.growth != 0 || atlas.entry_count > 0);
        self.grips = are_kept.then(|| {
            atlases.each_ref().map(|atlas| Grips {
                entries: atlas.entry_count,
                complete: matches!(atlas.growth(), AtlasGrowth::Complete | AtlasGrowth::NothingFound),
            })
        });
    }
}

/// Writes the table, or the rows as JSON.
pub(super) fn write(rows: &[Row], output: Output) -> Result<(), Failure> {
    output.write(&rows, |rows| text(rows))
}

fn text(rows: &[Row]) -> String {
    let mut all = table(&[
        "object",
        "",
        ">mass",
        "density",
        ">triangles",
        ">grips r + l",
        ">givers",
        "notes",
    ]);
    for row in rows {
        let state = match (&row.error, row.created) {
            (Some(_), _) => "rejected",
            (None, true) => "new",
            (None, false) => "",
        };
        all.add_row([
            row.name.clone(),
            state.to_owned(),
            row.mass_kg
                .map_or_else(String::new, |mass| format!("{:.0} g", 1000.0 * mass)),
            row.density.as_ref().map_or_else(String::new, density),
            row.triangles.map_or_else(String::new, |count| count.to_string()),
            row.grips.map_or_else(String::new, |[right, left]| {
                format!("{} + {}", right.entries, left.entries)
            }),
            givers(&row.givers),
            row.notes(),
        ]);
    }
    all.to_string()
}

fn density(density: &Density) -> String {
    let material = density.material.unwrap_or("by default");
    format!("{:.0} kg/m³, {material}", density.kg_per_m3)
}

/// The test givers from whom the object was taken, of those that were requested.
fn givers(givers: &Givers) -> String {
    match givers.requested {
        0 => String::new(),
        requested => format!("{} of {requested}", givers.answered),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_say_mass_density_grips_and_why_not() {
        let mut row = Row::new("mug", Path::new("a/Mug.obj"));
        row.created = true;
        row.mass_kg = Some(0.35);
        row.density = Some(Density {
            material: None,
            kg_per_m3: 400.0,
        });
        row.triangles = Some(1984);
        let grips = |entries| Grips {
            entries,
            complete: true,
        };
        row.grips = Some([grips(2048), grips(1990)]);
        row.givers = Givers {
            requested: 12,
            tried: 11,
            answered: 10,
            last_failure: Some("limited by the giver".to_owned()),
        };
        let mut wrong = Row::new("bolt", Path::new("bolt.stl"));
        wrong.error = Some("mesh: has no triangles".to_owned());
        let text = text(&[row, wrong]);
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
