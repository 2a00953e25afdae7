//! The services of the contract: unwrap, call the domain, map the error.

mod grasp;
mod objects;

use std::sync::Arc;

use grasp_assets::obj::ObjLimits;
use grasp_synthesis::base::mechanisms::Mechanisms;

pub(crate) use grasp::GraspHandler;
pub(crate) use objects::ObjectHandler;

use crate::{
    atlases::Atlases, budget::BudgetLimits, objects::store::ObjectStore, search::executor::SearchExecutor,
};

/// What the handlers share.
#[derive(Debug)]
pub(crate) struct Shared {
    /// The objects.
    pub objects: Arc<ObjectStore>,
    /// What is known of how hands hold them.
    pub atlases: Atlases,
    /// The search pool.
    pub executor: SearchExecutor,
    /// How long searches may take.
    pub budgets: BudgetLimits,
    /// How large meshes may be.
    pub obj_limits: ObjLimits,
    /// The receiving hand's rig unless a request names one.
    pub default_rig: String,
    /// The mechanisms that searches run.
    pub mechanisms: Mechanisms,
}

/// An OBJ's bytes and the other fields of a request: what may be received beyond the mesh.
pub(crate) const BYTES_BESIDE_MESH: usize = 1 << 20;

/// Largest request of `GraspService`: a hand of 26 joints takes about 2 kB.
pub(crate) const LARGEST_FIND_REQUEST: usize = 64 << 10;

/// Largest answer of either service: a full page of objects takes less than 1 MiB.
pub(crate) const LARGEST_ANSWER: usize = 4 << 20;
