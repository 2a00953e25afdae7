//! Small runs, whole, cut short, extended and refused.

mod beyond;
mod folder;
mod made;
mod reported;
mod support;
