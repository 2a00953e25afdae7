//! Hands, objects, holdouts and requirements.

mod hand;
mod object;
mod requirements;
