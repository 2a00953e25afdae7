//! The domain's data types, without search algorithms: hands, objects, holdouts, contacts, grasps, scores, strategies
//! and
//! a request's requirements.

pub mod banned_grip;
pub mod bend_ratios;
pub mod check;
pub mod forces;
pub mod grasp;
pub mod grasp_type;
pub mod hand;
pub mod holdout;
pub mod object;
pub mod obstacle;
pub mod parts;
pub mod plain_object;
pub mod receiver;
pub mod regions;
pub mod requirements;
pub mod score;
pub mod strategy;
