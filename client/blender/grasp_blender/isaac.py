"""Grasps in the text format isaac_grasp 1.0, which Isaac Sim's Grasp Editor reads."""

import json

from .kinematics import angles_of
from .messages import DIGITS, pose

_JOINTS = ("base_yaw", "base_pitch", "second_pitch", "third_pitch")


def yaml(object_name, grasps):
    """The file of grasps in the object's frame and OpenXR's axes, best first: the wrist is the gripper's frame, joints are named
    after the digit and the angle ("index_base_pitch"); the pre-grasp is the open hand at the object."""
    lines = [
        "format: isaac_grasp",
        "format_version: 1.0",
        f"object_frame: {json.dumps(object_name)}",
        "gripper_frame: wrist",
        "grasps:",
    ]
    for index, grasp in enumerate(grasps):
        (x, y, z), (i, j, k, w) = pose(grasp["hand"]["objectFromWrist"])
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
