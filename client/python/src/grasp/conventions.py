"""Converts points, directions, poses and joints between the conventions of OpenXR, Unity, Unreal and Godot.

Every function takes numpy arrays with any leading dimensions, and names of conventions: `conventions.points(p, "unity", "openxr")`
converts from Unity's axes to OpenXR's. Conversions from any convention to any other one are exact up to rounding.

Points in an object's frame, such as contacts, need `at_object=True`: for "unity_flip_x" and "unreal_xzy", importers turn meshes, and
with them the frames of objects.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .poses import Array, Convention, Joints, quaternion_from_matrix, transforms


class _Axes(NamedTuple):
    """A convention's axes, against OpenXR's."""

    #: The change of basis: the columns are OpenXR's axes in the engine's. It may mirror.
    basis: Array
    #: Units per meter.
    unit: float = 1.0
    #: Turns meshes from the engine's axes to those of its importer.
    importer: Array = np.eye(3)
    #: The engine's axes of a hand's joint, in OpenXR's.
    joint: Array = np.eye(3)
    #: Lists of joints begin with the wrist, then the palm.
    wrist_first: bool = False


_UNITY = _Axes(np.diag([1.0, 1.0, -1.0]), wrist_first=True)
_UNREAL = _Axes(np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), unit=100)
_AXES: dict[Convention, _Axes] = {
    "openxr": _Axes(np.eye(3)),
    "unity": _UNITY,
    "unreal": _UNREAL,
    # A half turn about (0, -1, 1).
    "godot": _Axes(np.eye(3), joint=np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])),
    "unity_flip_x": _UNITY._replace(importer=np.diag([-1.0, 1.0, -1.0])),
    "unreal_xzy": _UNREAL._replace(importer=np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])),
}


def lengths(lengths: npt.ArrayLike, source: Convention, target: Convention) -> Array:
    """Converts lengths, such as radii."""
    return np.asarray(lengths, float) * (_AXES[target].unit / _AXES[source].unit)


def directions(
    directions: npt.ArrayLike, source: Convention, target: Convention, *, at_object: bool = False
) -> Array:
    """Converts directions, normals or forces (..., 3): the axes change, lengths do not."""
    turn = _left(target, at_object) @ _left(source, at_object).T
    turned: Array = np.asarray(directions, float) @ turn.T
    return turned


def points(points: npt.ArrayLike, source: Convention, target: Convention, *, at_object: bool = False) -> Array:
    """Converts points (..., 3)."""
    return lengths(directions(points, source, target, at_object=at_object), source, target)


def poses(poses: npt.ArrayLike, source: Convention, target: Convention) -> Array:
    """Converts poses (..., 4, 4) in the client's frame of anything but objects and joints of hands, such as heads and boxes."""
    return _poses(poses, source, target, _AXES[source].basis, _AXES[target].basis)


def object_poses(client_from_object: npt.ArrayLike, source: Convention, target: Convention) -> Array:
    """Converts poses (..., 4, 4) of objects."""
    return _poses(client_from_object, source, target, _left(source, True), _left(target, True))


def joint_poses(joints: npt.ArrayLike, source: Convention, target: Convention, *, at_object: bool = False) -> Array:
    """Converts poses (..., 4, 4) of joints of hands, such as wrists."""
    right = [_AXES[convention].basis @ _AXES[convention].joint.T for convention in (source, target)]
    return _poses(joints, source, target, *right, at_object=at_object)


def joints(joints: Joints, target: Convention, *, at_object: bool = False) -> Joints:
    """Converts a hand's joints, and their order."""
    source = joints.convention
    rows = np.arange(len(joints.positions))
    if len(rows) == 26 and _AXES[source].wrist_first != _AXES[target].wrist_first:
        rows[:2] = 1, 0
    present = ~np.isnan(joints.positions[rows]).any(1)
    converted = joint_poses(joints.poses[rows][present], source, target, at_object=at_object)
    positions, orientations = np.full((len(rows), 3), np.nan), np.full((len(rows), 4), np.nan)
    positions[present] = converted[:, :3, 3]
    orientations[present] = quaternion_from_matrix(converted[:, :3, :3])
    return Joints(positions, orientations, lengths(joints.radii[rows], source, target), joints.handedness, target)


def _left(convention: Convention, at_object: bool) -> Array:
    """Maps directions in OpenXR's axes to the convention's, in the client's frame or in an object's."""
    axes = _AXES[convention]
    return axes.importer @ axes.basis if at_object else axes.basis


def _poses(
    poses: npt.ArrayLike,
    source: Convention,
    target: Convention,
    source_right: Array,
    target_right: Array,
    *,
    at_object: bool = False,
) -> Array:
    """Converts poses whose own axes the right matrices map from OpenXR's."""
    poses = np.asarray(poses, float)
    left = _left(target, at_object) @ _left(source, at_object).T
    rotation = left @ poses[..., :3, :3] @ source_right @ target_right.T
    return transforms(points(poses[..., :3, 3], source, target, at_object=at_object), rotation)
