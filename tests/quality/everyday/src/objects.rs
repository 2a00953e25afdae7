//! Reads the objects from `objects/*.toml`. The README says how they are written.

use std::iter;

use glam::DVec3;
use serde::Deserialize;

use crate::{
    about::{EverydayObject, Fill, Hands, Source, Surface},
    sketch::{Arc, Ellipse, Outline, Sketch, ball, rod, rounded, turned, vessel, y_axis, z_axis},
};

/// The files, in the order of the objects.
const FILES: [&str; 4] = [
    include_str!("../objects/pocket.toml"),
    include_str!("../objects/kitchen.toml"),
    include_str!("../objects/house.toml"),
    include_str!("../objects/outdoors.toml"),
];

/// Corners of a body of revolution that names none.
const AROUND: usize = 24;

/// Corners of the section of a tube that names none.
const SECTION: usize = 12;

/// All everyday objects.
pub fn everyday_objects() -> Vec<EverydayObject> {
    FILES.into_iter().flat_map(read).collect()
}

/// The objects of a file.
///
/// # Panics
/// The text is not as the README says.
fn read(text: &'static str) -> Vec<EverydayObject> {
    let file: File<'static> = toml::from_str(text).unwrap_or_else(|error| panic!("{error}"));
    file.object.into_iter().map(Object::build).collect()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File<'a> {
    #[serde(borrow)]
    object: Vec<Object<'a>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Object<'a> {
    name: &'a str,
    what: &'a str,
    size_mm: [f64; 3],
    source: Source,
    surface: Surface,
    #[serde(default, borrow)]
    forbidden: Vec<&'a str>,
    /// Why one hand does not suffice; `None` if it does.
    #[serde(borrow)]
    two_hands: Option<&'a str>,
    shapes: Vec<Shape<'a>>,
}

/// One body or sheet, of exactly one of the forms from `lathe` to `sheet`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Shape<'a> {
    /// Begins a part with a mass; `None` if the shape goes on with the last one.
    #[serde(borrow)]
    part: Option<&'a str>,
    /// Mass of the part, if it is solid.
    kg: Option<f64>,
    /// Mass of the part, if it is hollow or a sheet.
    skin_kg: Option<f64>,

    #[serde(default)]
    at: DVec3,
    #[serde(default = "y_axis")]
    up: DVec3,
    #[serde(default = "unstretched")]
    stretch: DVec3,
    /// Repeats the shape, mirrored, before it.
    mirror: Option<Axis>,
    /// Repeats the shape in rows; of the last row the places are next to each other.
    #[serde(default)]
    repeat: Vec<Row>,

    lathe: Option<Vec<[f64; 2]>>,
    rod: Option<[f64; 3]>,
    ball: Option<f64>,
    slab: Option<DVec3>,
    loft: Option<Vec<Vec<DVec3>>>,
    outline: Option<Outline>,
    hoop: Option<Ellipse>,
    path: Option<Vec<DVec3>>,
    arc: Option<Arc>,
    sheet: Option<Vec<Vec<DVec3>>>,

    /// Of a lathe: the thickness of the vessel's wall.
    wall: Option<f64>,
    /// Of lathes, tubes and hoops.
    corners: Option<usize>,
    /// Of a slab.
    #[serde(default)]
    corner: f64,
    #[serde(default)]
    bevel: f64,
    /// Of an outline: how far it is moved inward, and its z.
    #[serde(default)]
    levels: Vec<[f64; 2]>,
    /// Of a path: how far from its corners it is cut round, or how many even steps lead from its first point to its last.
    round: Option<f64>,
    steps: Option<usize>,
    /// Of a path: the angle in degrees by which it is turned about the y axis.
    #[serde(default)]
    turn: f64,
    #[serde(default = "z_axis")]
    normal: DVec3,
    /// Of tubes and hoops: radii, or halves of the size along the normal and across it, at even shares of the path.
    #[serde(default)]
    radii: Vec<f64>,
    #[serde(default)]
    section: Vec<[f64; 2]>,
    /// Of a sheet: heights at which its rows are repeated.
    #[serde(default = "ground")]
    heights: Vec<f64>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Axis {
    X,
    Z,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    times: u32,
    by: DVec3,
}

fn unstretched() -> DVec3 {
    DVec3::ONE
}

fn ground() -> Vec<f64> {
    vec![0.0]
}

impl Object<'static> {
    fn build(self) -> EverydayObject {
        let mut sketch = Sketch::new();
        for shape in &self.shapes {
            assert_eq!(shape.forms(), 1, "{}: a shape has one form", self.name);
            shape.draw(&mut sketch);
        }
        EverydayObject {
            name: self.name,
            what: self.what,
            size_mm: self.size_mm,
            source: self.source,
            surface: self.surface,
            parts: sketch.parts,
            forbidden: self.forbidden,
            hands: self.two_hands.map_or(Hands::One, |why| Hands::Beyond { why }),
            is_closed: sketch.is_closed,
            shape: sketch.mesh.finish(),
        }
    }
}

impl Shape<'static> {
    fn forms(&self) -> usize {
        let forms = [
            self.lathe.is_some(),
            self.rod.is_some(),
            self.ball.is_some(),
            self.slab.is_some(),
            self.loft.is_some(),
            self.outline.is_some(),
            self.hoop.is_some(),
            self.path.is_some() || self.arc.is_some(),
            self.sheet.is_some(),
        ];
        forms.into_iter().filter(|is_given| *is_given).count()
    }

    fn draw(&self, sketch: &mut Sketch) {
        if let Some(name) = self.part {
            sketch.part(name, self.fill(name));
        }
        let mirrored = self.mirror.map(|axis| match axis {
            Axis::X => DVec3::new(-1.0, 1.0, 1.0),
            Axis::Z => DVec3::new(1.0, 1.0, -1.0),
        });
        let mut shifts = vec![DVec3::ZERO];
        for row in &self.repeat {
            let along = |shift: DVec3| (0..row.times).map(move |step| shift + f64::from(step) * row.by);
            shifts = shifts.into_iter().flat_map(along).collect();
        }
        for side in mirrored.into_iter().chain(iter::once(DVec3::ONE)) {
            for &shift in &shifts {
                sketch.place(side * (self.at + shift), side * self.up, self.stretch);
                self.draw_form(sketch, side);
            }
        }
    }

    fn fill(&self, name: &str) -> Fill {
        match (self.kg, self.skin_kg) {
            (Some(mass), None) => Fill::Solid(mass),
            (None, Some(mass)) => Fill::Skin(mass),
            _ => panic!("the part {name} has either kg or skin_kg"),
        }
    }

    fn draw_form(&self, sketch: &mut Sketch, side: DVec3) {
        let corners = self.corners.unwrap_or(SECTION);
        if let Some(profile) = self.profile() {
            sketch.lathe(self.corners.unwrap_or(AROUND), &profile);
        } else if let Some(size) = self.slab {
            sketch.slab(size, self.corner, self.bevel);
        } else if let Some(rings) = &self.loft {
            sketch.loft(rings);
        } else if let Some(outline) = &self.outline {
            let levels = self.levels.iter().map(|&[inset, z]| outline.points(inset, z));
            sketch.loft(&levels.collect::<Vec<_>>());
        } else if let Some(ellipse) = &self.hoop {
            sketch.hoop(&ellipse.points(), ellipse.normal(), corners, self.section_at(0.0));
        } else if let Some(rows) = &self.sheet {
            let at = |height: f64| {
                let raised =
                    move |row: &Vec<DVec3>| row.iter().map(|&point| point + DVec3::Y * height).collect();
                rows.iter().map(raised)
            };
            let rows: Vec<Vec<DVec3>> = self.heights.iter().flat_map(|&height| at(height)).collect();
            sketch.sheet(&rows);
        } else {
            let turn = turned(self.turn);
            let points = self.points().into_iter();
            let path: Vec<DVec3> = points.map(|point| side * (turn * point)).collect();
            sketch.tube(&path, turn * self.normal, corners, |share| self.section_at(share));
        }
    }

    fn profile(&self) -> Option<Vec<[f64; 2]>> {
        let profile = self.lathe.clone();
        let profile = profile
            .or_else(|| self.rod.map(rod))
            .or_else(|| self.ball.map(ball))?;
        Some(match self.wall {
            Some(wall) => vessel(&profile, wall),
            None => profile,
        })
    }

    /// The points of a path, then those of its arc.
    fn points(&self) -> Vec<DVec3> {
        let path = self.path.as_deref().unwrap_or_default();
        let mut points = match (self.round, self.steps, path) {
            (Some(reach), ..) => rounded(path, reach),
            (None, Some(steps), &[first, .., last]) => (0..=steps)
                .map(|step| first.lerp(last, step as f64 / steps as f64))
                .collect(),
            _ => path.to_vec(),
        };
        points.extend(self.arc.iter().flat_map(Arc::points));
        points
    }

    /// The section at a share of a path.
    fn section_at(&self, share: f64) -> [f64; 2] {
        let radii = self.radii.iter().map(|&radius| [radius, radius]);
        let sections: Vec<[f64; 2]> = self.section.iter().copied().chain(radii).collect();
        let place = share * sections.len().saturating_sub(1) as f64;
        let [before, after] = [place.floor(), place.ceil()].map(|place| sections[place as usize]);
        [0, 1].map(|k| before[k] + place.fract() * (after[k] - before[k]))
    }
}
