//! Hands, objects, holdouts and requirements.

mod hand;
mod holdout;
mod object;
mod recorded_hands;
mod requirements;
