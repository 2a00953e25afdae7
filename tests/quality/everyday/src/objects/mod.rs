//! The objects by family. Lengths are millimetres, masses kilograms; +Y is up.

mod carried;
mod desk;
mod household;
mod kitchen;
mod leisure;
mod long;
mod small;
mod table;
mod tools;

use glam::DVec3;

use crate::about::EverydayObject;

/// All everyday objects.
pub fn everyday_objects() -> Vec<EverydayObject> {
    [
        small::objects(),
        desk::objects(),
        table::objects(),
        kitchen::objects(),
        household::objects(),
        carried::objects(),
        tools::objects(),
        long::objects(),
        leisure::objects(),
    ]
    .concat()
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}
