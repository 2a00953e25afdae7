"""Packed grasps, which replicate a grasp to other players in some 57 bytes."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from . import v1
from .kinematics import DIGITS, Digit, posed_joints
from .poses import Array, Convention, Joints, Side, convention_name, convention_number, matrix, pose_message, side_number

_VERSION = 1
#: Version, hand, contacts, type, convention, size, exponent, wrist's position and orientation, length of the rig's id.
_HEAD = struct.Struct("<6Bb3h4hB")


@dataclass(frozen=True, eq=False)
class PackedGrasp:
    """A grasp as its bytes have it: wrist within 0.1 mm, angles within 0.05 degrees."""

    #: "rigs/adult" or the like.
    rig: str
    #: The hand's side.
    handedness: Side
    #: The hand's size over its rig's.
    scale: float
    #: The convention of the wrist's pose.
    convention: Convention
    #: The wrist's pose in the object's frame, 4x4.
    object_from_wrist: Array
    #: (5, 4) in radians, thumb first: base yaw, base, second and third pitch. NaN for a digit that the hand does not have.
    angles: Array
    #: The digits that touch the object, thumb first.
    contact_digits: tuple[Digit, ...]
    #: The palm touches it.
    palm_contact: bool
    #: The type, such as "tip_pinch"; "unspecified" if it matches none.
    type: str

    @classmethod
    def decode(cls, packed: bytes) -> PackedGrasp:
        """Decodes `Grasp.packed`.

        Raises:
            ValueError: the bytes are no packed grasp, or of a newer version.
        """
        if len(packed) < _HEAD.size or packed[0] != _VERSION:
            raise ValueError(f"not a packed grasp of version {_VERSION}: {packed[:8].hex()}…")
        _, hand, contacts, kind, convention, size, exponent, *numbers, id_length = _HEAD.unpack_from(packed)
        present = [row for row in range(5) if hand >> row + 1 & 1]
        start = _HEAD.size + id_length
        if len(packed) != start + 6 * len(present):
            raise ValueError(f"a packed grasp of {len(present)} digits has {start + 6 * len(present)} bytes, not {len(packed)}")
        angles = np.full((5, 4), np.nan)
        pairs = np.frombuffer(packed, np.uint8, offset=start).reshape(-1, 2, 3).astype(int)
        steps = np.stack([pairs[..., 0] | (pairs[..., 1] & 15) << 8, pairs[..., 1] >> 4 | pairs[..., 2] << 4], -1)
        angles[present] = (steps.reshape(-1, 4) - 2048) * np.pi / 2048
        return cls(
            rig="rigs/" + packed[_HEAD.size : start].decode("ascii"),
            handedness="right" if hand & 1 else "left",
            scale=size / 100,
            convention=convention_name(convention),
            object_from_wrist=matrix((np.ldexp(numbers[:3], exponent), numbers[3:])),
            angles=angles,
            contact_digits=tuple(digit for row, digit in enumerate(DIGITS) if contacts >> row & 1),
            palm_contact=bool(contacts >> 5 & 1),
            type=v1.GraspType.Name(kind).removeprefix("GRASP_TYPE_").lower(),
        )

    def joints(self, rig: v1.HandRig) -> Joints:
        """The 26 joints in the object's frame, from the rig as `client.rigs.get(packed.rig)` returns it."""
        return posed_joints(
            rig,
            self.handedness,
            self.angles,
            self.object_from_wrist,
            scale=self.scale,
            convention=self.convention,
            at_object=True,
        )

    def hand_pose(self) -> v1.HandPose:
        """The hand as a request takes it, for instance to check it or to hold on to it."""
        hand = v1.HandPose(
            rig=self.rig,
            handedness=side_number(self.handedness),
            scale=self.scale,
            object_from_wrist=pose_message(self.object_from_wrist),
            convention=convention_number(self.convention),
        )
        for digit, angles in zip(DIGITS, self.angles.tolist(), strict=True):
            if np.isfinite(angles).all():
                yaw, base, second, third = angles
                bent = v1.DigitAngles(base_yaw=yaw, base_pitch=base, second_pitch=second, third_pitch=third)
                getattr(hand, digit).CopyFrom(bent)
        return hand
