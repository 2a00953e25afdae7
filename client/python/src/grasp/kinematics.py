"""The joints of a hand from its rig and its angles: forward kinematics."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from . import conventions, v1
from .poses import Array, Convention, Joints, PoseLike, Side, convention_name, matrix, quaternion_from_matrix
from .poses import side_name

#: A finger or the thumb.
Digit: TypeAlias = Literal["thumb", "index", "middle", "ring", "little"]
DIGITS: tuple[Digit, ...] = get_args(Digit)

#: The first of the three joints at which each digit bends, among OpenXR's 26.
_BASES = (2, 7, 12, 17, 22)


def hand_joints(rig: v1.HandRig, hand: v1.HandPose) -> Joints:
    """The joints of a posed hand of a rig, in the client's frame and the hand's convention.

    A hand without `client_from_wrist` gets joints in the object's frame.
    """
    in_client = hand.HasField("client_from_wrist")
    wrist = hand.client_from_wrist if in_client else hand.object_from_wrist
    scale = hand.scale if hand.HasField("scale") else 1.0
    return posed_joints(
        rig,
        side_name(hand.handedness),
        digit_angles(hand),
        wrist,
        scale=scale,
        convention=convention_name(hand.convention),
        at_object=not in_client,
    )


def digit_angles(hand: v1.HandPose) -> Array:
    """Angles (5, 4) in radians, thumb first: base yaw, base, second and third pitch. NaN without the digit."""
    angles = np.full((5, 4), np.nan)
    for row, digit in enumerate(DIGITS):
        if hand.HasField(digit):
            angles[row] = _angles(getattr(hand, digit))
    return angles


def posed_joints(
    rig: v1.HandRig,
    handedness: Side,
    angles: npt.ArrayLike,
    frame_from_wrist: PoseLike,
    *,
    scale: float = 1.0,
    convention: Convention = "openxr",
    at_object: bool = False,
) -> Joints:
    """The joints of a rig's hand with the given angles (5, 4), in the frame and the convention of its wrist."""
    (hand,) = (hand for hand in rig.hands if side_name(hand.handedness) == handedness)
    rest = Joints.from_messages(hand.stretched_joints, handedness, "openxr")
    stretched = rest.poses
    stretched[:, :3, 3] *= scale
    wrist_from_joint = stretched.copy()
    for limits in hand.limits:
        row = limits.digit - v1.DIGIT_THUMB
        base = _BASES[row]
        turns = _turns(row, handedness, np.asarray(angles, float)[row])
        # The stretched hand has the angles nearest to 0.
        straight = np.clip(0, *(_angles(bound) for bound in (limits.min, limits.max)))
        turns_at_rest = _turns(row, handedness, straight)
        moved = np.eye(4)
        for joint, turn, at_rest in zip(range(base, base + 3), turns, turns_at_rest, strict=True):
            there = stretched[joint]
            moved = moved @ there @ at_rest.T @ turn @ np.linalg.inv(there)
            wrist_from_joint[joint] = moved @ there
        wrist_from_joint[base + 3] = moved @ stretched[base + 3]
    openxr = conventions.joint_poses(matrix(frame_from_wrist), convention, "openxr", at_object=at_object)
    posed = openxr @ wrist_from_joint
    present = np.isfinite(posed).all((1, 2))
    orientations = np.full((26, 4), np.nan)
    orientations[present] = quaternion_from_matrix(posed[present, :3, :3])
    joints = Joints(posed[:, :3, 3], orientations, rest.radii * scale, handedness)
    return conventions.joints(joints, convention, at_object=at_object)


def _turns(row: int, handedness: Side, angles: Array) -> list[Array]:
    """How a digit with these angles turns at its three joints, in their own axes."""
    yaw, base, second, third = angles
    # Positive yaw turns a finger to the little one's side, and lifts the thumb.
    sign = (1 if row == 0 else -1) * (1 if handedness == "right" else -1)
    return [_about(1, sign * yaw) @ _about(0, -base), _about(0, -second), _about(0, -third)]


def _about(axis: Literal[0, 1], angle: float) -> Array:
    """A turn (4, 4) about x or y."""
    s, c = np.sin(angle), np.cos(angle)
    turn = np.eye(4)
    following, last = (axis + 1) % 3, (axis + 2) % 3
    turn[following, following] = turn[last, last] = c
    turn[last, following], turn[following, last] = s, -s
    return turn


def _angles(bent: v1.DigitAngles) -> Array:
    third = bent.third_pitch if bent.HasField("third_pitch") else bent.second_pitch * 2 / 3
    return np.array([bent.base_yaw, bent.base_pitch, bent.second_pitch, third])
