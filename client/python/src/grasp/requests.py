"""The options of calls, and the messages that they become. None, where it is allowed, is as good as absent."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from os import PathLike
from pathlib import Path
from typing import Any, Generic, Literal, TypeAlias, TypedDict, TypeVar

import numpy.typing as npt
from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import Message

from . import v1
from .poses import Convention, Joints, PoseLike, Side, convention_number, pose_message, side_number, vector_message
from .results import Grasp

#: A time in seconds.
Seconds: TypeAlias = float | timedelta

#: A hand to keep clear of.
HandLike: TypeAlias = Joints | Grasp | v1.PresentingHand | v1.HandPose | v1.HandJoints | v1.HandMesh

#: Bytes of a mesh's file, or its path.
Mesh: TypeAlias = "bytes | str | PathLike[str]"

#: Called with the bytes sent and all bytes.
Progress: TypeAlias = Callable[[int, int], None]

#: Largest mesh in bytes that is sent in one message, the default limit of servers.
_MAX_MESSAGE = 8 << 20

#: Bytes of a mesh in one part of an upload; the server takes up to 1 MiB.
_PIECE = 256 << 10

#: Slowest upload in bytes per second; extends the call's time.
_SLOWEST_UPLOAD = 1 << 20

M = TypeVar("M", bound=Message)


class CallOptions(TypedDict, total=False):
    """Options of every call."""

    #: Seconds until the call fails with `DeadlineExceeded`, retries included; a search ends some 5 ms earlier, without an error. By
    #: default, the client's timeout, and the budget.
    timeout: float | None


class FrameOptions(TypedDict, total=False):
    """The parts of a holdout that move."""

    #: The object's pose in the client's frame. By default the identity.
    client_from_object: PoseLike | None
    #: The giver's hand. By default, nobody holds the object.
    presenting_hand: HandLike | None
    #: Up to 3 further hands to keep clear of.
    other_hands: Sequence[HandLike]
    #: Up to 64 obstacles, by `box`, `tube` and `half_space`.
    obstacles: Sequence[v1.Shape]
    #: Direction opposite to gravity, in the client's frame. By default the convention's up axis.
    up: npt.ArrayLike | None


class ObjectOptions(TypedDict, total=False):
    """The object as this request has it."""

    #: Its size over that at its creation: 0.25 to 4.
    scale: float | None
    #: Its mass in kilograms.
    mass_kg: float | None


class GraspOptions(TypedDict, total=False):
    """Which grasps are wanted, and the answer's form."""

    #: The hand to pose: left, right, both together, or the message for its rig, size and body. By default, the better one.
    receiver: Side | Literal["both"] | v1.Receiver | None
    #: Constraints on grasps.
    requirements: v1.Requirements | None
    #: Axes, unit and joint order of the request and its answer. By default "openxr".
    convention: Convention | None
    #: Plan the motion to the grasp: `message.key_frames`.
    key_frames: bool
    #: Also answer the grasp in few bytes, for `PackedGrasp`.
    packed: bool


class SearchOptions(TypedDict, total=False):
    """How to search."""

    #: Time limit of the search. By default the server's; in a track, 8 ms.
    budget: Seconds | None
    #: Which valid grasp to return. By default "first_valid".
    choice: Literal["first_valid", "best_within_budget", "reproducible"] | None
    #: Seed of all random streams. By default drawn by the server.
    seed: int | None
    #: Further options, such as a number of attempts.
    search: v1.SearchOptions | None


class HoldoutOptions(FrameOptions, ObjectOptions, GraspOptions, CallOptions, total=False):
    """Options of all calls about a holdout."""


class FindOptions(HoldoutOptions, SearchOptions, total=False):
    """Options of `find`."""

    #: The grasp to hold on to, mostly the last answer's; the message for more.
    current: Grasp | v1.HandPose | v1.CurrentGrasp | None


class StreamOptions(HoldoutOptions, SearchOptions, total=False):
    """Options of `stream`."""

    #: Every better grasp, at most this many a second, up to 1000. By default 30.
    max_rate_hz: float | None
    #: Instead, this many of the best ones that differ, at the end of the budget and best first: 1 to 32.
    alternatives: int | None
    #: Properties by which those differ. By default the approach.
    differ_by: Sequence[Literal["approach", "type", "region"]]


class ValidateOptions(HoldoutOptions, total=False):
    """Options of `validate`."""

    #: Time to search for a valid grasp near it. By default there is no search.
    nearest_budget: Seconds | None


class EvaluateOptions(HoldoutOptions, SearchOptions, total=False):
    """Options of `evaluate`."""

    #: Up to 64 further poses of the giver's hand.
    other_presenting_hands: Sequence[HandLike]


class TrackOptions(ObjectOptions, GraspOptions, SearchOptions, total=False):
    """Options of `track`."""

    #: Seconds until an answer to a frame is given up. By default the client's timeout.
    timeout: float | None
    #: Direction opposite to gravity, in the client's frame. By default the convention's up axis.
    up: npt.ArrayLike | None
    #: The grasp to begin with.
    current: Grasp | v1.HandPose | None
    #: How much higher another grasp's score must be to replace a valid one: 0 to 1. By default a valid one is kept.
    min_score_gain: float | None
    #: Least time between changes to better grasps: up to 60 s.
    min_dwell: Seconds | None
    #: How late answers are shown: up to 0.5 s.
    prediction_horizon: Seconds | None
    #: How long a grasp is kept that a trembling hand comes too close to: up to 5 s, by default 0.2 s.
    grace: Seconds | None
    #: The receiver's other hand may take over.
    may_change_hand: bool
    #: Of a kept grasp, answer only wrists and score.
    changes_only: bool


class PushOptions(FrameOptions, total=False):
    """Options of a track's frames."""

    #: Another object, taken without a grasp at first. By default the one before.
    object: str | None
    #: The receiver's body, all of it. By default as before.
    receiver: v1.Receiver | None
    #: Where the receiver's hand is now. By default at the last answer.
    receiving_hand: Grasp | v1.HandPose | None
    #: The hand is closing.
    committed: bool
    #: When the frame was captured, since any moment. By default when it arrives.
    capture_time: Seconds | None


class CreateOptions(TypedDict, total=False):
    """Options of `objects.create`, which `GraspObject` describes."""

    labels: Mapping[str, str]
    center_of_mass: npt.ArrayLike | None
    friction: float | None
    regions: Sequence[v1.Region]
    known_grips: Sequence[v1.KnownGrip]
    meters_per_unit: float | None
    z_up: bool
    parts: Sequence[str]
    #: Called as the mesh is sent, in pieces then.
    progress: Progress | None
    timeout: float | None


@dataclass(frozen=True)
class Prepared(Generic[M]):
    """A message to send."""

    message: M
    #: The call's time, if the caller named it.
    timeout: float | None = None
    #: Time beyond the client's timeout, in seconds.
    extra: float = 0.0


def find(object: str, options: FindOptions) -> Prepared[v1.FindGraspRequest]:
    current = options.get("current")
    if isinstance(current, (Grasp, v1.HandPose)):
        current = v1.CurrentGrasp(grasp=_pose(current))
    message = v1.FindGraspRequest(holdout=_holdout(object, options), search=_search(options), current=current)
    return _prepared(message, options, options.get("budget"))


def stream(object: str, options: StreamOptions) -> Prepared[v1.StreamGraspsRequest]:
    count = options.get("alternatives")
    differ_by = [f"DIFFER_BY_{name.upper()}" for name in options.get("differ_by", ())]
    message = v1.StreamGraspsRequest(
        holdout=_holdout(object, options),
        search=_search(options),
        max_rate_hz=options.get("max_rate_hz"),
        alternatives=None if count is None else v1.Alternatives(count=count, differ_by=differ_by),
    )
    return _prepared(message, options, options.get("budget"))


def validate(
    object: str, hand: Grasp | Joints | v1.HandPose | v1.HandJoints, options: ValidateOptions
) -> Prepared[v1.ValidateGraspRequest]:
    message = v1.ValidateGraspRequest(
        holdout=_holdout(object, options), nearest_budget=_duration(options.get("nearest_budget"))
    )
    if isinstance(hand, (Grasp, v1.HandPose)):
        message.pose.CopyFrom(_pose(hand))
    else:
        message.joints.CopyFrom(_joints(hand, options.get("convention")))
    return _prepared(message, options, options.get("nearest_budget"))


def evaluate(object: str, options: EvaluateOptions) -> Prepared[v1.EvaluateHoldoutRequest]:
    convention = options.get("convention")
    message = v1.EvaluateHoldoutRequest(
        holdout=_holdout(object, options),
        search=_search(options),
        other_presenting_hands=[_hand(hand, convention) for hand in options.get("other_presenting_hands", ())],
    )
    return _prepared(message, options, options.get("budget"))


def track(object: str, options: TrackOptions) -> v1.Track:
    current = options.get("current")
    message = v1.Track(
        holdout=v1.Holdout(
            object=object, scale=options.get("scale"), mass_kg=options.get("mass_kg"), up=_vector(options.get("up"))
        ),
        search=_search(options),
        current=None if current is None else _pose(current),
        min_score_gain=options.get("min_score_gain"),
        min_dwell=_duration(options.get("min_dwell")),
        prediction_horizon=_duration(options.get("prediction_horizon")),
        grace=_duration(options.get("grace")),
        may_change_hand=options.get("may_change_hand", False),
    )
    _set_grasp_options(message, options)
    message.output.changes_only = options.get("changes_only", False)
    return message


def frame(sequence: int, convention: Convention | None, options: PushOptions) -> v1.TrackFrame:
    receiving = options.get("receiving_hand")
    return v1.TrackFrame(
        sequence=sequence,
        capture_time=_duration(options.get("capture_time")),
        holdout=_surroundings(options.get("object") or "", options, convention),
        receiver=options.get("receiver"),
        receiving_hand=None if receiving is None else _pose(receiving),
        committed=options.get("committed", False),
    )


def create_object(
    name: str, mesh: Mesh, mass_kg: float, options: CreateOptions
) -> tuple[Prepared[v1.CreateObjectRequest], Callable[[], Iterator[v1.UploadObjectRequest]] | None]:
    """The request and, if the mesh is sent in pieces, a function that yields the parts, for each attempt anew."""
    content = mesh if isinstance(mesh, bytes) else Path(mesh).read_bytes()
    progress = options.get("progress")
    described = v1.GraspObject(
        name=name,
        mass_kg=mass_kg,
        labels=options.get("labels"),
        center_of_mass=_vector(options.get("center_of_mass")),
        friction=options.get("friction"),
        regions=options.get("regions"),
        known_grips=options.get("known_grips"),
        meters_per_unit=options.get("meters_per_unit"),
        z_up=options.get("z_up", False),
        parts=options.get("parts"),
    )
    # Makes the call safe to repeat.
    message = v1.CreateObjectRequest(object=described, request_id=str(uuid.uuid4()))
    extra = len(content) / _SLOWEST_UPLOAD
    prepared = Prepared(message, options.get("timeout"), extra)
    if progress is None and len(content) <= _MAX_MESSAGE:
        message.mesh = content
        return prepared, None
    return prepared, lambda: _upload(message, content, progress)


def create_rig(
    rig_id: str, models: Sequence[Mesh], handedness: Side | None, timeout: float | None
) -> Prepared[v1.CreateRigRequest]:
    contents = [model if isinstance(model, bytes) else Path(model).read_bytes() for model in models]
    side = None if handedness is None else side_number(handedness)
    return Prepared(v1.CreateRigRequest(rig_id=rig_id, models=contents, handedness=side), timeout)


def box(half_extents: npt.ArrayLike, pose: PoseLike | None = None) -> v1.Shape:
    """A box by half its edges, with the origin of its pose at its center."""
    return v1.Shape(box=v1.BoxShape(half_extents=vector_message(half_extents), pose=_message(pose)))


def tube(points: Sequence[npt.ArrayLike], radii: float | Sequence[float]) -> v1.Shape:
    """All that is within a radius of a line through 1 to 64 points: one is a ball, two make a capsule."""
    each = [radii] if isinstance(radii, (int, float)) else radii
    return v1.Shape(tube=v1.TubeShape(points=[vector_message(point) for point in points], radii=each))


def half_space(point: npt.ArrayLike, normal: npt.ArrayLike) -> v1.Shape:
    """One side of a plane through a point; the normal points into it: down, of a floor."""
    return v1.Shape(half_space=v1.HalfSpaceShape(point=vector_message(point), normal=vector_message(normal)))


def seconds(time: Seconds) -> float:
    return time.total_seconds() if isinstance(time, timedelta) else float(time)


def _prepared(message: M, options: HoldoutOptions, budget: Seconds | None) -> Prepared[M]:
    _set_grasp_options(message, options)
    return Prepared(message, options.get("timeout"), 0 if budget is None else seconds(budget))


def _holdout(object: str, options: HoldoutOptions) -> v1.Holdout:
    holdout = _surroundings(object, options, options.get("convention"))
    scale, mass_kg = options.get("scale"), options.get("mass_kg")
    holdout.MergeFrom(v1.Holdout(scale=scale, mass_kg=mass_kg))
    return holdout


def _surroundings(object: str, options: FrameOptions, convention: Convention | None) -> v1.Holdout:
    hand = options.get("presenting_hand")
    return v1.Holdout(
        object=object,
        client_from_object=_message(options.get("client_from_object")),
        presenting_hand=None if hand is None else _hand(hand, convention),
        other_hands=[_hand(other, convention) for other in options.get("other_hands", ())],
        obstacles=options.get("obstacles"),
        up=_vector(options.get("up")),
    )


def _set_grasp_options(message: Any, options: GraspOptions) -> None:
    receiver = options.get("receiver")
    if receiver == "both":
        message.receiver.both_hands = True
    elif isinstance(receiver, str):
        message.receiver.handedness = side_number(receiver)
    elif receiver is not None:
        message.receiver.CopyFrom(receiver)
    requirements = options.get("requirements")
    if requirements is not None:
        message.requirements.CopyFrom(requirements)
    convention = options.get("convention")
    if convention is not None:
        message.output.convention = convention_number(convention)
    message.output.key_frames = options.get("key_frames", False)
    message.output.packed = options.get("packed", False)


def _search(options: SearchOptions) -> v1.SearchOptions:
    search = v1.SearchOptions()
    further, choice = options.get("search"), options.get("choice")
    if further is not None:
        search.CopyFrom(further)
    search.MergeFrom(
        v1.SearchOptions(
            budget=_duration(options.get("budget")),
            choice=None if choice is None else f"GRASP_CHOICE_{choice.upper()}",
            seed=options.get("seed"),
        )
    )
    return search


def _hand(hand: HandLike, convention: Convention | None) -> v1.PresentingHand:
    if isinstance(hand, v1.PresentingHand):
        return hand
    if isinstance(hand, v1.HandMesh):
        return v1.PresentingHand(mesh=hand)
    if isinstance(hand, (Grasp, v1.HandPose)):
        return v1.PresentingHand(pose=_pose(hand))
    return v1.PresentingHand(joints=_joints(hand, convention))


def _joints(joints: Joints | v1.HandJoints, convention: Convention | None) -> v1.HandJoints:
    if isinstance(joints, v1.HandJoints):
        return joints
    if joints.convention != (convention or "openxr"):
        raise ValueError(
            f"the joints are in the convention {joints.convention}, the request in {convention or 'openxr'}: "
            "name that of the joints, or convert them by grasp.conventions.joints"
        )
    return joints.message()


def _pose(hand: Grasp | v1.HandPose) -> v1.HandPose:
    return hand.message.hand if isinstance(hand, Grasp) else hand


def _message(pose: PoseLike | None) -> v1.Pose | None:
    return None if pose is None else pose_message(pose)


def _vector(vector: npt.ArrayLike | None) -> v1.Vector3 | None:
    return None if vector is None else vector_message(vector)


def _duration(time: Seconds | None) -> Duration | None:
    if time is None:
        return None
    duration = Duration()
    duration.FromNanoseconds(round(seconds(time) * 1e9))
    return duration


def _upload(
    create: v1.CreateObjectRequest, mesh: bytes, progress: Progress | None
) -> Iterator[v1.UploadObjectRequest]:
    yield v1.UploadObjectRequest(create=create, total_bytes=len(mesh))
    for start in range(0, len(mesh), _PIECE):
        piece = mesh[start : start + _PIECE]
        yield v1.UploadObjectRequest(piece=piece)
        if progress is not None:
            progress(start + len(piece), len(mesh))
    yield v1.UploadObjectRequest(sha256=hashlib.sha256(mesh).hexdigest())
