"""Grasps in the text format isaac_grasp 1.0, which Isaac Sim's Grasp Editor and `grasp objects` read."""

import json
import math

from .axes import about, composed
from .kinematics import angles_of
from .messages import DIGITS, pose

_JOINTS = ("base_yaw", "base_pitch", "second_pitch", "third_pitch")
_FILE_FROM_Z_UP = ((0.0, 0.0, 0.0), about(0, math.pi / 2))


def files(present, grasps):
    """The files of an object's grasps, best first, by "left" and "right", as the format has one gripper per file.

    The gripper is "rigs/RIG/SIDE", with "/SCALE" of another size; position and orientation are those of its wrist's joint in the
    axes of the object's file and meters; joints are named after digit and angle ("index_base_pitch"); the pre-grasp is the open
    hand at the object.
    """
    hands = dict.fromkeys(grasp["hand"]["handedness"] for grasp in grasps)
    return {
        hand.removeprefix("HANDEDNESS_").lower(): _file(present, [grasp for grasp in grasps if grasp["hand"]["handedness"] == hand])
        for hand in hands
    }


def _file(present, grasps):
    hand = grasps[0]["hand"]
    size = f"/{hand['scale']:g}" if hand.get("scale", 1) != 1 else ""
    lines = [
        "format: isaac_grasp",
        "format_version: 1.0",
        f"object_frame: {json.dumps(present['name'])}",
        f"gripper_frame: {hand['rig']}/{hand['handedness'].removeprefix('HANDEDNESS_').lower()}{size}",
        "grasps:",
    ]
    for index, grasp in enumerate(grasps):
        wrist = pose(grasp["hand"]["objectFromWrist"])
        (x, y, z), (i, j, k, w) = composed(_FILE_FROM_Z_UP, wrist) if present.get("zUp") else wrist
        lines += [
            f"  grasp_{index}:",
            f"    confidence: {grasp.get('score', 0.0):.6f}",
            f"    position: [{x:.7f}, {y:.7f}, {z:.7f}]",
            f"    orientation: {{w: {w:.8f}, xyz: [{i:.8f}, {j:.8f}, {k:.8f}]}}",
            f"    cspace_position: {_joints(grasp['hand'])}",
        ]
        if frame := open_frame(grasp):
            lines.append(f"    pregrasp_cspace_position: {_joints(frame['hand'])}")
    return "\n".join(lines) + "\n"


def open_frame(grasp):
    """The key frame of the open hand at the object, or None."""
    frames = grasp.get("keyFrames", ())
    return next((frame for frame in frames if frame["kind"] == "KEY_FRAME_KIND_PRE_GRASP"), None)


def _joints(hand):
    present = [digit for digit in DIGITS if digit in hand]
    angles = ((f"{digit}_{joint}", angle) for digit in present for joint, angle in zip(_JOINTS, angles_of(hand[digit])))
    return "{" + ", ".join(f"{joint}: {angle:.6f}" for joint, angle in angles) + "}"
