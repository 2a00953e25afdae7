"""Axes of engines: the only place that converts between them, OpenXR and Blender.

A pose is ((x, y, z), (x, y, z, w)): a position and a unit quaternion. OpenXR is right-handed, +Y up, in meters; a joint's -Z
points to the fingertip, its +Y out of the back of the hand. Blender is right-handed, +Z up: (x, y, z) of OpenXR is (x, -z, y)
there, as glTF is imported, and a joint's +Y points to the fingertip, its +Z out of the back of the hand.
"""

import math
from typing import NamedTuple

IDENTITY = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def product(a, b):
    """The quaternion of rotation b, then a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q):
    """The opposite rotation."""
    return (-q[0], -q[1], -q[2], q[3])


def rotated(q, v):
    """A vector after a rotation."""
    return product(product(q, (*v, 0.0)), conjugate(q))[:3]


def about(axis, angle):
    """The rotation about a coordinate axis (0 to 2), in radians."""
    q = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    q[axis] = math.sin(angle / 2)
    return tuple(q)


def from_columns(x, y, z):
    """The quaternion whose rotation takes the coordinate axes to x, y and z."""
    trace = x[0] + y[1] + z[2]
    candidates = [
        (y[2] - z[1], z[0] - x[2], x[1] - y[0], 1 + trace),
        (1 + 2 * x[0] - trace, y[0] + x[1], z[0] + x[2], y[2] - z[1]),
        (y[0] + x[1], 1 + 2 * y[1] - trace, z[1] + y[2], z[0] - x[2]),
        (z[0] + x[2], z[1] + y[2], 1 + 2 * z[2] - trace, x[1] - y[0]),
    ]
    longest = max(candidates, key=lambda q: sum(part * part for part in q))
    length = math.sqrt(sum(part * part for part in longest))
    return tuple(part / length for part in longest)


def composed(a_from_b, b_from_c):
    """The pose a_from_c."""
    moved = rotated(a_from_b[1], b_from_c[0])
    return tuple(a + b for a, b in zip(a_from_b[0], moved)), product(a_from_b[1], b_from_c[1])


def inverse(pose):
    """The pose b_from_a of a_from_b."""
    turn = conjugate(pose[1])
    return rotated(turn, tuple(-part for part in pose[0])), turn


class Axes(NamedTuple):
    """Axes and unit of an engine."""

    # For each of its axes, the axis of OpenXR along it, and the sign.
    from_openxr: tuple
    units_per_meter: float = 1.0
    # An OpenXR joint's axes in those of the engine's joints.
    joint_turn: tuple = (0.0, 0.0, 0.0, 1.0)
    # The joints that OpenXR has first, in the engine's order.
    first_joints: tuple = (0, 1)
    # The engine's own axes in those that its importer gives to objects.
    object_turn: tuple = (0.0, 0.0, 0.0, 1.0)

    def _mirrors(self):
        (a, s), (b, t), (c, u) = self.from_openxr
        even = (a, b, c) in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        return s * t * u if even else -s * t * u

    def direction_from_openxr(self, v):
        """A direction, or a force in newtons."""
        return tuple(sign * v[axis] for axis, sign in self.from_openxr)

    def direction_to_openxr(self, v):
        """A direction, or a force in newtons."""
        result = [0.0, 0.0, 0.0]
        for part, (axis, sign) in zip(v, self.from_openxr):
            result[axis] = sign * part
        return tuple(result)

    def point_from_openxr(self, v):
        """A point."""
        return tuple(self.units_per_meter * part for part in self.direction_from_openxr(v))

    def point_to_openxr(self, v):
        """A point."""
        return tuple(part / self.units_per_meter for part in self.direction_to_openxr(v))

    def pose_from_openxr(self, pose):
        """A pose of anything but a joint."""
        turn = self.direction_from_openxr(pose[1][:3])
        return self.point_from_openxr(pose[0]), (*(self._mirrors() * part for part in turn), pose[1][3])

    def pose_to_openxr(self, pose):
        """A pose of anything but a joint."""
        turn = self.direction_to_openxr(pose[1][:3])
        return self.point_to_openxr(pose[0]), (*(self._mirrors() * part for part in turn), pose[1][3])

    def joint_to_openxr(self, pose):
        """The pose of a joint of a hand."""
        position, turn = self.pose_to_openxr(pose)
        return position, product(turn, self.joint_turn)

    def object_to_openxr(self, pose):
        """The pose of an object."""
        return self.pose_to_openxr((pose[0], product(pose[1], self.object_turn)))

    def in_object_to_openxr(self, v):
        """A direction in an object's frame, or a point in the engine's unit."""
        return self.direction_to_openxr(rotated(conjugate(self.object_turn), v))

    def joint_in_object_to_openxr(self, pose):
        """The pose of a joint in an object's frame."""
        turn = conjugate(self.object_turn)
        return self.joint_to_openxr((rotated(turn, pose[0]), product(turn, pose[1])))


_ROOT = math.sqrt(0.5)
_SAME = ((0, 1), (1, 1), (2, 1))
_UNITY = ((0, 1), (1, 1), (2, -1))
_UNREAL = ((2, -1), (0, 1), (1, 1))

BLENDER = Axes(((0, 1), (2, -1), (1, 1)))
# By the names of the contract.
CONVENTIONS = {
    "CONVENTION_OPENXR": Axes(_SAME),
    "CONVENTION_UNITY": Axes(_UNITY, first_joints=(1, 0)),
    "CONVENTION_UNREAL": Axes(_UNREAL, units_per_meter=100.0),
    "CONVENTION_GODOT": Axes(_SAME, joint_turn=(0.0, -_ROOT, _ROOT, 0.0)),
    "CONVENTION_UNITY_FLIP_X": Axes(_UNITY, first_joints=(1, 0), object_turn=(0.0, 1.0, 0.0, 0.0)),
    "CONVENTION_UNREAL_XZY": Axes(_UNREAL, units_per_meter=100.0, object_turn=(0.0, 0.0, -_ROOT, _ROOT)),
}
