"""Answers with their numbers as numpy arrays. Everything else is in `.message`, as the contract describes it."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from . import v1
from .poses import Array, Convention, Joints, Side, convention_name, matrix, side_name, vector


class Grasp:
    """A hand that holds the object, in the request's convention."""

    def __init__(self, message: v1.Grasp) -> None:
        self.message = message

    @property
    def handedness(self) -> Side:
        """The hand's side."""
        return side_name(self.message.hand.handedness)

    @property
    def convention(self) -> Convention:
        """The convention of all poses, points and lengths."""
        return convention_name(self.message.hand.convention)

    @property
    def type(self) -> str:
        """The type, such as "tip_pinch"; "unspecified" if it matches none."""
        return v1.GraspType.Name(self.message.type).removeprefix("GRASP_TYPE_").lower()

    @property
    def score(self) -> float | None:
        """The score, from 0 to 1, or None if it was not rated."""
        return self.message.score if self.message.HasField("score") else None

    @property
    def packed(self) -> bytes:
        """The grasp in few bytes, for `PackedGrasp.decode`; empty unless the request has `packed`."""
        return self.message.packed

    @cached_property
    def client_from_wrist(self) -> Array:
        """The wrist's pose in the client's frame, 4x4."""
        return matrix(self.message.hand.client_from_wrist)

    @cached_property
    def object_from_wrist(self) -> Array:
        """The wrist's pose in the object's frame, 4x4."""
        return matrix(self.message.hand.object_from_wrist)

    @cached_property
    def joints(self) -> Joints:
        """The 26 joints in the client's frame."""
        return Joints.from_messages(self.message.hand.joints, self.handedness, self.convention)

    @cached_property
    def contact_positions(self) -> Array:
        """Contacts (N, 3) in the object's frame."""
        return _rows([vector(contact.position) for contact in self.message.contacts])

    @cached_property
    def contact_normals(self) -> Array:
        """Outward unit normals (N, 3) in the object's frame."""
        return _rows([vector(contact.normal) for contact in self.message.contacts])

    @cached_property
    def contact_forces(self) -> Array:
        """Forces (N, 3) that the hand applies, in newtons, in the object's frame."""
        return _rows([vector(contact.force) for contact in self.message.contacts])

    def __repr__(self) -> str:
        return f"<Grasp {self.handedness} {self.type} score={self.score}>"


class FindResult:
    """The answer to a holdout, or a message of a stream of grasps."""

    def __init__(self, message: v1.FindGraspResponse) -> None:
        self.message = message
        #: The grasp; two if both hands hold the object; empty if none was found in time.
        self.grasps = [Grasp(grasp) for grasp in message.grasps]

    @property
    def grasp(self) -> Grasp | None:
        """The first grasp, if there is one."""
        return self.grasps[0] if self.grasps else None

    @property
    def outcome(self) -> str:
        """How the search ended: "found", "budget_exhausted" or "aborted"; "unspecified" while it goes on."""
        return v1.Outcome.Name(self.message.outcome).removeprefix("OUTCOME_").lower()

    def __repr__(self) -> str:
        return f"<FindResult {self.outcome} {self.grasps}>"


class TrackAnswer:
    """The answer to a frame of a track."""

    def __init__(self, message: v1.TrackAnswer) -> None:
        self.message = message
        #: The grasp, if there is one.
        self.grasp = Grasp(message.grasp) if message.HasField("grasp") else None

    @property
    def status(self) -> str:
        """The status of the grasp: "kept", "adjusted", "replanned", "none" or "aborted"."""
        return v1.CurrentGraspStatus.Name(self.message.current.status).removeprefix("CURRENT_GRASP_STATUS_").lower()

    def __repr__(self) -> str:
        return f"<TrackAnswer {self.message.sequence} {self.status} {self.grasp}>"


def _rows(vectors: list[Array]) -> Array:
    return np.array(vectors).reshape(-1, 3)
