//! How a request is to be searched, and in which axes.

use serde::{Deserialize, Serialize};

/// Axes, units and joint order of the client's engine. The server converts; this library passes numbers unchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Convention {
    /// Right-handed, +Y up, metres. Also fits Bevy and `WebXR`.
    #[default]
    #[serde(rename = "openxr")]
    OpenXr,
    /// Left-handed, +Y up, +Z forward, metres; joint order of XR Hands (wrist first, then palm).
    Unity,
    /// Left-handed, +Z up, +X forward, centimetres; joint order of `EHandKeypoint`.
    Unreal,
    /// Right-handed, +Y up, metres; joint orientations of `XRHandTracker`.
    Godot,
    /// As `Unity`, with frames of objects as importers make them that flip x.
    UnityFlipX,
    /// As `Unreal`, with frames of objects as its own importer of glTF makes them.
    UnrealXzy,
}

/// The checks that a valid grasp must pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Validity {
    /// The checks of the thesis, chapters 4 and 5.
    Thesis,
    /// Hands are solid, and the contacts hold the object with forces inside their friction cones and with force closure.
    Physical,
}

/// Search strategy. A to F are the ladder of chapter 5 of the thesis: each adds one step to the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Strategy {
    /// Naive synthesis (5.2).
    A,
    /// Placement measures relative to the object (5.3).
    B,
    /// Palm-CoM-palm angle (5.3).
    C,
    /// Early stop if the thumb has no contact (5.4).
    D,
    /// Fewer bend ratios per finger (5.4, Figure 5.20).
    E,
    /// First sufficient force distribution (5.6).
    F,
    /// Beyond the thesis: places hands at opposed surfaces and starts from known grasps.
    Guided,
}

/// The bend ratios that a finger tries: the columns of Figure 5.20.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BendRatios {
    /// (a) 0.7, 1 and 1.42 in turn.
    All,
    /// (b) As (a), but fingers skip 0.7.
    AllFingersWithoutLow,
    /// (c) One of the three, at random.
    OneRandom,
    /// (d) As (c), but fingers skip 0.7.
    OneRandomFingersWithoutLow,
    /// (e) Only 1.
    OnlyOne,
    /// (f) Only 1.42.
    OnlyHigh,
}

/// Which valid grasp is returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// The first one found, or a better one found within [`FindRequest::improvement`](crate::FindRequest::improvement) if it is
    /// one that a person would not choose.
    FirstValid,
    /// The one with the highest score (of both hands: the highest mean) among all found within the budget. Without a budget
    /// in the request, that is 5 ms; if nothing is found by then, the first one found within the server's default budget is
    /// returned.
    BestWithinBudget,
}

/// Whether known grasps may be tried first: those of the object's atlas, and those learned from earlier
/// searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AtlasUse {
    /// Known grasps are tried first.
    Allowed,
    /// Known grasps are not used: the answer depends on the request alone.
    None,
}

/// How many of the receiver's hands take the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hands {
    /// The receiving hand alone.
    One,
    /// Left and right hand together, for what one hand cannot hold. Requires [`Validity::Physical`] and
    /// [`Strategy::Guided`]; cannot be combined with [`plan_key_frames`](crate::FindRequest::plan_key_frames). Constraints
    /// apply to each hand. Known grasps are neither used nor collected.
    Both,
}
