"""Poses and joints of hands as numpy arrays, and as the contract's messages.

A pose is a 4x4 matrix that maps points of its frame to its parent's: `a_from_b @ [x, y, z, 1]`. Quaternions are x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from . import v1

Array: TypeAlias = npt.NDArray[np.float64]

#: A pose: a 4x4 matrix, a position and a quaternion, or the message.
PoseLike: TypeAlias = "npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike] | v1.Pose"

#: A hand's side.
Side: TypeAlias = Literal["left", "right"]

#: Axes, unit and joint order of an engine, as the contract's `Convention` describes them.
Convention: TypeAlias = Literal["openxr", "unity", "unreal", "godot", "unity_flip_x", "unreal_xzy"]


def matrix_from_quaternion(xyzw: npt.ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), which need not have unit length but must not be 0."""
    q = np.asarray(xyzw, float)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    v, w = q[..., :3], q[..., 3, None, None]
    outer = v[..., :, None] * v[..., None, :]
    square = (v * v).sum(-1)[..., None, None]
    rotation: Array = (w * w - square) * np.eye(3) + 2 * (outer + w * _cross_matrix(v))
    return rotation


def quaternion_from_matrix(rotation: npt.ArrayLike) -> Array:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3), with w >= 0."""
    m = np.asarray(rotation, float)
    # The eigenvector of the largest eigenvalue (I. Y. Bar-Itzhack, 2000), the nearest rotation of a matrix that is none.
    k = np.empty((*m.shape[:-2], 4, 4))
    trace = np.trace(m, axis1=-2, axis2=-1)[..., None, None]
    k[..., :3, :3] = m + np.swapaxes(m, -1, -2) - trace * np.eye(3)
    k[..., :3, 3] = k[..., 3, :3] = np.stack(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1
    )
    k[..., 3, 3] = trace[..., 0, 0]
    q: Array = np.linalg.eigh(k)[1][..., -1]
    return np.where(q[..., 3:] < 0, -q, q)


def matrix(pose: PoseLike) -> Array:
    """A pose as a 4x4 matrix."""
    if isinstance(pose, tuple):
        position, orientation = pose
    elif isinstance(pose, v1.Pose):
        position, orientation = vector(pose.position), _quaternion(pose)
    else:
        given = np.asarray(pose, float)
        if given.shape != (4, 4) or not np.allclose(given[3], [0, 0, 0, 1], rtol=0, atol=1e-6):
            raise ValueError(f"a pose is a 4x4 matrix whose last row is 0, 0, 0, 1, not {given!r}")
        return given
    return transforms(position, matrix_from_quaternion(orientation))


def transforms(position: npt.ArrayLike, rotation: npt.ArrayLike) -> Array:
    """4x4 matrices (..., 4, 4) of positions (..., 3) and rotation matrices (..., 3, 3)."""
    rotation = np.asarray(rotation, float)
    result = np.zeros((*rotation.shape[:-2], 4, 4))
    result[..., :3, :3] = rotation
    result[..., :3, 3] = position
    result[..., 3, 3] = 1
    return result


def pose_message(pose: PoseLike) -> v1.Pose:
    """A pose as a message."""
    if isinstance(pose, v1.Pose):
        return pose
    if isinstance(pose, tuple):
        position, orientation = (np.asarray(part, float) for part in pose)
    else:
        a_from_b = matrix(pose)
        rotation = a_from_b[:3, :3]
        if not np.allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=1e-3) or np.linalg.det(rotation) < 0:
            raise ValueError(f"the matrix of a pose turns and moves, without scale, shear or mirror, unlike {a_from_b!r}")
        position, orientation = a_from_b[:3, 3], quaternion_from_matrix(rotation)
    x, y, z, w = map(float, orientation)
    return v1.Pose(position=vector_message(position), orientation=v1.Quaternion(x=x, y=y, z=z, w=w))


def vector(message: v1.Vector3) -> Array:
    """A message's point or direction as an array (3,)."""
    return np.array([message.x, message.y, message.z])


def vector_message(vector: npt.ArrayLike) -> v1.Vector3:
    """A point or a direction as a message."""
    x, y, z = map(float, np.asarray(vector, float))
    return v1.Vector3(x=x, y=y, z=z)


def side_number(side: Side) -> v1.Handedness:
    """The contract's number of a hand's side."""
    if side not in get_args(Side):
        raise ValueError(f"a hand is left or right, not {side!r}")
    return v1.HANDEDNESS_LEFT if side == "left" else v1.HANDEDNESS_RIGHT


def side_name(number: int) -> Side:
    """The hand's side of a message."""
    return "left" if number == v1.HANDEDNESS_LEFT else "right"


def convention_number(convention: Convention) -> v1.Convention:
    """The contract's number of a convention."""
    if convention not in get_args(Convention):
        raise ValueError(f"a convention is one of {', '.join(get_args(Convention))}, not {convention!r}")
    return getattr(v1, f"CONVENTION_{convention.upper()}")  # type: ignore[no-any-return]


def convention_name(number: int) -> Convention:
    """The convention of a message."""
    known = get_args(Convention)
    return known[number - 1] if 1 <= number <= len(known) else "openxr"


class Joints:
    """A hand's joints: the 26 of OpenXR in the convention's order, or the 25 of WebXR, which lack the palm.

    A request takes them wherever it takes a hand, in the request's convention. Rows of a digit that the hand does not have are NaN.

    Attributes:
        positions: (26, 3), in the convention's unit.
        orientations: (26, 4), unit quaternions x, y, z, w.
        radii: (26,), distances from joint to skin in the same unit; 0 if unknown.
        handedness: the hand's side.
        convention: the convention of all of it.
    """

    def __init__(
        self,
        positions: npt.ArrayLike,
        orientations: npt.ArrayLike,
        radii: npt.ArrayLike | None,
        handedness: Side,
        convention: Convention = "openxr",
    ) -> None:
        self.positions: Array = np.asarray(positions, float)
        count = len(self.positions)
        self.orientations: Array = np.asarray(orientations, float)
        self.radii: Array = np.zeros(count) if radii is None else np.asarray(radii, float)
        self.handedness: Side = handedness
        self.convention: Convention = convention
        shapes = (self.positions.shape, self.orientations.shape, self.radii.shape)
        if count not in (25, 26) or shapes != ((count, 3), (count, 4), (count,)):
            raise ValueError(f"26 joints have positions (26, 3), orientations (26, 4) and radii (26,), not {shapes}")

    @property
    def poses(self) -> Array:
        """The joints as matrices (26, 4, 4)."""
        return transforms(self.positions, matrix_from_quaternion(self.orientations))

    @classmethod
    def from_messages(cls, joints: Sequence[v1.JointPose], handedness: Side, convention: Convention) -> Joints:
        """The joints of an answer, a request or a rig."""
        positions = np.full((len(joints), 3), np.nan)
        orientations = np.full((len(joints), 4), np.nan)
        for row, joint in enumerate(joints):
            if joint.HasField("pose"):
                positions[row] = vector(joint.pose.position)
                orientations[row] = _quaternion(joint.pose)
        return cls(positions, orientations, [joint.radius for joint in joints], handedness, convention)

    def message(self) -> v1.HandJoints:
        """The joints as a tracked hand of a request."""
        rows = zip(self.positions, self.orientations, self.radii, strict=True)
        joints = [
            v1.JointPose()
            if np.isnan(position).any()
            else v1.JointPose(pose=pose_message((position, orientation)), radius=float(radius))
            for position, orientation, radius in rows
        ]
        return v1.HandJoints(handedness=side_number(self.handedness), joints=joints)


def _quaternion(pose: v1.Pose) -> tuple[float, float, float, float]:
    q = pose.orientation
    return (q.x, q.y, q.z, q.w) if pose.HasField("orientation") else (0, 0, 0, 1)


def _cross_matrix(v: Array) -> Array:
    """The matrices that multiply by v from the left, as a cross product."""
    zero = np.zeros(v.shape[:-1])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, -1) for row in rows], -2)
