//! Hands, objects, holdouts and constraints.

mod changed_properties;
mod constraints;
mod fit;
mod forbidden_surfaces;
mod holdout;
mod kinematics;
mod openxr_frames;
mod posed_skin;
mod recorded_hands;
mod regions;
mod rig_description;
