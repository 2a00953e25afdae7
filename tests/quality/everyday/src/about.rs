//! Properties of an object apart from its shape, and the files made of it.

use std::fmt::Write as _;

use crate::mesh_builder::Shape;
use glam::DVec3;
use serde::Deserialize;

/// An everyday object. Its frame has the origin at the centre of the mesh's bounding box, and +Y up in the pose in which
/// the thing usually stands, lies or is carried.
#[derive(Clone, Debug, PartialEq)]
pub struct EverydayObject {
    /// In kebab case; unique, and an object's id on the server.
    pub name: &'static str,
    /// Description in a few words.
    pub what: &'static str,
    /// Edges of the real thing's bounding box along x, y and z, in millimetres; the mesh keeps to them.
    pub size_mm: [f64; 3],
    /// Where size and mass are from.
    pub source: Source,
    /// The material that skin touches.
    pub surface: Surface,
    /// Groups of the mesh, each with its mass.
    pub parts: Vec<Part>,
    /// Groups that must not be touched.
    pub forbidden: Vec<&'static str>,
    /// Whether one hand can hold it.
    pub hands: Hands,
    /// True if every surface is closed; false if some part is a sheet of no thickness.
    pub is_closed: bool,
    pub(crate) shape: Shape,
}

/// A material. Coefficients are static, of dry or slightly moist fingers that press with a few newtons to some
/// tens; the README names their sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Surface {
    /// Bare or lacquered metal.
    Metal,
    /// Glass and glazed china.
    Glass,
    /// Smooth or grained plastic.
    Plastic,
    /// Rubber and soft handles.
    Rubber,
    /// Wood, planed or lacquered.
    Wood,
    /// Paper, card and cardboard.
    Paper,
    /// Woven or felted cloth.
    Cloth,
    /// Leather.
    Leather,
    /// Bricks and surfaces as rough as sandpaper.
    Rough,
    /// Fruit, eggshell, leaves, wax.
    Natural,
}

impl Surface {
    /// The coefficient of static friction.
    pub fn friction(self) -> f64 {
        match self {
            // Between 0.38, pinched with 20 to 39 N (Buchholz 1988), and 0.6 at 1 to 20 N (Seo 2009).
            Self::Metal => 0.49,
            // As smooth and tight as metal; the upper of the two figures, because moisture stays.
            Self::Glass => 0.6,
            // Smooth vinyl (Buchholz 1988).
            Self::Plastic => 0.53,
            // Rubber hoses (Seo 2009).
            Self::Rubber => 0.9,
            // Textured vinyl (Buchholz 1988).
            Self::Wood | Self::Natural => 0.5,
            // Between 0.27 dry and 0.42 moist (Buchholz 1988).
            Self::Paper => 0.35,
            // Cotton (Zhang and Mak 1999).
            Self::Cloth => 0.51,
            // Suede, between 0.39 dry and 0.66 moist (Buchholz 1988).
            Self::Leather => 0.52,
            // Sandpaper (Buchholz 1988).
            Self::Rough => 0.61,
        }
    }

    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Metal => "metal",
            Self::Glass => "glass",
            Self::Plastic => "plastic",
            Self::Rubber => "rubber",
            Self::Wood => "wood",
            Self::Paper => "paper",
            Self::Cloth => "cloth",
            Self::Leather => "leather",
            Self::Rough => "rough",
            Self::Natural => "natural",
        }
    }
}

/// A group of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The group's name in the OBJ text.
    pub name: &'static str,
    /// Its mass and where that sits.
    pub fill: Fill,
}

/// Where the mass of a part sits; masses in kilograms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fill {
    /// Spread evenly over the volume.
    Solid(f64),
    /// Spread evenly over the surface: hollow things and sheets.
    Skin(f64),
}

/// Whether one hand can hold an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hands {
    /// One hand suffices.
    One,
    /// The object takes two hands.
    Beyond {
        /// Why one hand does not suffice.
        why: &'static str,
    },
}

/// Origin of sizes and masses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// A standard or the rules of a sport.
    Standard,
    /// Data sheets of common products.
    Product,
    /// Typical sizes of things that grow or are built by hand.
    Typical,
}

impl Source {
    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Product => "product",
            Self::Typical => "typical",
        }
    }
}

impl Fill {
    fn mass_kg(self) -> f64 {
        match self {
            Self::Solid(mass) | Self::Skin(mass) => mass,
        }
    }
}

impl EverydayObject {
    /// The mass in kilograms.
    pub fn mass_kg(&self) -> f64 {
        self.parts.iter().map(|part| part.fill.mass_kg()).sum()
    }

    /// The centre of mass in metres; `None` if the mass is spread evenly over the volume.
    pub fn centre_of_mass(&self) -> Option<DVec3> {
        if let [
            Part {
                fill: Fill::Solid(_), ..
            },
        ] = self.parts[..]
        {
            return None;
        }
        let moment: DVec3 = self
            .parts
            .iter()
            .map(|part| part.fill.mass_kg() * self.centroid(*part))
            .sum();
        Some(moment / self.mass_kg())
    }

    /// The centroid of a part's volume or surface, in metres.
    fn centroid(&self, part: Part) -> DVec3 {
        let triangles = self.shape.groups.iter().filter(|(name, _)| *name == part.name);
        let (mut whole, mut moment) = (0.0, DVec3::ZERO);
        for triangle in triangles.flat_map(|(_, triangles)| triangles) {
            let [a, b, c] = triangle
                .map(|vertex| DVec3::from(self.shape.micrometres[vertex].map(|micro| micro as f64)) * 1e-6);
            let (size, centre) = match part.fill {
                Fill::Solid(_) => (a.dot(b.cross(c)) / 6.0, (a + b + c) / 4.0),
                Fill::Skin(_) => ((b - a).cross(c - a).length() / 2.0, (a + b + c) / 3.0),
            };
            whole += size;
            moment += size * centre;
        }
        moment / whole
    }

    /// Triangles of the mesh.
    pub fn triangle_count(&self) -> usize {
        self.shape
            .groups
            .iter()
            .map(|(_, triangles)| triangles.len())
            .sum()
    }

    /// The mesh as OBJ text in metres.
    pub fn obj(&self) -> String {
        self.shape
            .obj(&format!("{}, in metres; made by grasp-everyday", self.name))
    }

    /// The manifest next to the mesh in a server's folder of objects.
    pub fn manifest(&self) -> String {
        let mut text = format!("# {}\n", self.what);
        let mut line = |arguments: std::fmt::Arguments<'_>| {
            text.write_fmt(arguments).expect("a string takes any text");
        };
        line(format_args!("mass_kg = {:?}\n", rounded(self.mass_kg())));
        line(format_args!("friction = {:?}\n", self.surface.friction()));
        if let Some(centre) = self.centre_of_mass() {
            line(format_args!(
                "centre_of_mass = {:?}\n",
                centre.to_array().map(rounded)
            ));
        }
        if !self.forbidden.is_empty() {
            line(format_args!("\n[forbidden]\ngroups = {:?}\n", self.forbidden));
        }
        text
    }
}

/// All objects as lines of tab-separated values, with a header: name, description, size in millimetres, mass in kilograms,
/// material, friction, source, and why it is beyond one hand, empty if it is not.
pub fn table(objects: &[EverydayObject]) -> String {
    let mut text = "name\twhat\tsize_mm\tmass_kg\tsurface\tfriction\tsource\tbeyond_one_hand\n".to_owned();
    for object in objects {
        let beyond = match object.hands {
            Hands::One => "",
            Hands::Beyond { why } => why,
        };
        let [x, y, z] = object.size_mm;
        let _ = writeln!(
            text,
            "{}\t{}\t{x} x {y} x {z}\t{}\t{}\t{}\t{}\t{beyond}",
            object.name,
            object.what,
            rounded(object.mass_kg()),
            object.surface.name(),
            object.surface.friction(),
            object.source.name(),
        );
    }
    text
}

/// A number with six decimals, which hides the last bits of the arithmetic.
fn rounded(number: f64) -> f64 {
    // Adding zero turns −0 into 0.
    (number * 1e6).round() / 1e6 + 0.0
}
