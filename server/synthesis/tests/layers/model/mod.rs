//! Hands, objects, holdouts and requirements.

mod changed_properties;
mod fit;
mod forbidden_surfaces;
mod holdout;
mod kinematics;
mod openxr_frames;
mod posed_skin;
mod recorded_hands;
mod regions;
mod requirements;
mod rig_description;
