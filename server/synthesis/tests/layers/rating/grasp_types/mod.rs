//! Grasp types of the taxonomy: of hands made to be of a type, of the thesis' examples, and of implausible hands.

mod canonical;
mod cases;
mod made_grasps;
mod thesis_examples;
