//! Grasp types of the taxonomy: of hands that were made to be of a type, of the thesis' own examples, and of hands that
//! nobody would hold anything with.

mod canonical;
mod cases;
mod givers;
mod support;
