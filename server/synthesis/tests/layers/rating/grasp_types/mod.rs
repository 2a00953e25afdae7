//! Grasp types of the taxonomy: of hands made to be of a type, of the thesis' examples, of
//! hands that hold simple shapes, and of implausible hands.

mod cases;
mod examples;
mod made_grasps;
mod shapes;
