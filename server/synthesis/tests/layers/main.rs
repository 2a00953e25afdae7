//! Tests of the core, grouped by its layers. Shared objects, hands and searches are built in [`fixtures`], and only there.

mod base;
mod prelude;

mod fixtures {
    pub(crate) mod atlases;
    pub(crate) mod hands;
    pub(crate) mod meshes;
    pub(crate) mod objects;
    pub(crate) mod oracle;
    pub(crate) mod random;
    pub(crate) mod searches;
}

mod geometry {
    mod boxes;
    mod capsule;
    mod mesh_queries;
    mod shape;
}

mod known {
    mod atlas;
    mod learned_grips;
    mod moved_grips;
}

mod model {
    mod hand;
    mod object;
    mod requirements;
}

mod physical {
    mod balance;
    mod barriers;
    mod closing;
    mod closure;
    mod hand_solids;
}

mod propose {
    mod handles;
    mod placements;
    mod transferred_grips;
}

mod rating {
    mod grasp_types;
    mod scoring;
}

mod search {
    mod choice;
    mod current;
    mod hands;
    mod holdouts;
    mod key_frames;
    mod limits;
    mod race;
    mod verdicts;
}

mod thesis {
    mod placement_and_posing;
    mod validity;
}
