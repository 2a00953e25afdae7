//! The domain's data types, without search algorithms: hands, objects, holdouts, contacts, grasps, scores, strategies
//! and a request's requirements.

pub mod grasp;
pub mod grasp_type;
pub mod hand;
pub mod holdout;
pub mod object;
pub mod plain_object;
pub mod regions;
pub mod requirements;
pub mod score;
pub mod strategy;
