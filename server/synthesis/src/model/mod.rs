//! The nouns of the search, without any algorithm: hands, objects, holdouts, contacts, grasps and what is asked of them.

pub mod bend_ratios;
pub mod constraints;
pub mod forces;
pub mod grasp;
pub mod grasp_type;
pub mod hand;
pub mod holdout;
pub mod object;
pub mod score;
pub mod strategy;
