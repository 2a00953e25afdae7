"""Givers in files: a hand in JSON, or a motion as `grasp track --print-motion` writes it and a headset records it."""

import json
import pathlib
from typing import NamedTuple

from . import axes
from .axes import CONVENTIONS
from .connect import GraspError
from .kinematics import joints_of
from .messages import convention_of, hand_in_object, joints, pose, seconds

# Frames per second of a recording without times.
_USUAL_RATE = 90.0


class Holdout(NamedTuple):
    """A holdout as a request has it, and the convention of that request."""

    message: dict
    convention: str

    def client_from_object(self):
        """The object's pose in the client's frame, in OpenXR's axes."""
        return CONVENTIONS[self.convention].object_to_openxr(pose(self.message.get("clientFromObject")))


class Recording(NamedTuple):
    """A Track and its frames, as (seconds since the first, TrackFrame)."""

    track: dict
    frames: list

    def convention(self):
        """The convention of all its messages."""
        return convention_of(self.track.get("output", {}))

    def holdout_at(self, time):
        """The holdout of the last frame that is not after `time`, in seconds."""
        shown = [frame for at, frame in self.frames if at <= time + 1e-6] or [self.frames[0][1]]
        holdouts = [self.track["holdout"], *(frame.get("holdout", {}) for frame in shown)]
        ups = {"up": holdout["up"] for holdout in holdouts if "up" in holdout}
        # A frame has all else of its moment.
        return Holdout({"clientFromObject": {}, **ups, **holdouts[-1]}, self.convention())


def read_recording(path):
    """A recording {"track": Track, "frames": [TrackFrame, …]}. Raises GraspError if it is none."""
    content = _read(path)
    if not (isinstance(content, dict) and isinstance(content.get("frames"), list) and content["frames"] and "track" in content):
        raise GraspError("invalid_argument", f'{path} is no recording: it needs "track" and "frames"')
    times = [seconds(frame["captureTime"]) if "captureTime" in frame else None for frame in content["frames"]]
    if None in times:
        times = [index / _USUAL_RATE for index in range(len(times))]
    track = {"holdout": {}, **content["track"]}
    return Recording(track, [(time - times[0], frame) for time, frame in zip(times, content["frames"])])


def read_giver(path):
    """The giver of a JSON file: a HandPose, HandJoints or PresentingHand at an object at the origin, a Holdout, or a request
    with one. Raises GraspError if it is none."""
    content = _read(path)
    if not isinstance(content, dict):
        raise GraspError("invalid_argument", f"{path} has no hand")
    convention = convention_of(content.get("output", {}))
    if "holdout" in content:
        content = content["holdout"]
    if "presentingHand" in content:
        return Holdout(content, convention)
    if any(form in content for form in ("pose", "joints", "mesh")) and "handedness" not in content:
        return Holdout({"presentingHand": content}, convention)
    if "rig" in content:
        return Holdout({"presentingHand": {"pose": content}}, convention)
    if "joints" in content:
        return Holdout({"presentingHand": {"joints": content}}, convention)
    raise GraspError("invalid_argument", f"{path} has no hand")


def giver_joints(client, holdout):
    """The giver's handedness and 26 joints in the object's frame, in OpenXR's axes; (None, []) of a mesh and of nobody.
    Raises GraspError if there are too few."""
    try:
        return _giver_joints(client, holdout)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, StopIteration) as error:
        raise GraspError("invalid_argument", f"presenting_hand: is incomplete: {error}") from None


def _giver_joints(client, holdout):
    giver = holdout.message.get("presentingHand", {})
    client_from_object = holdout.client_from_object()
    if hand := giver.get("pose"):
        posed = hand_in_object(hand, holdout.convention, client_from_object)
        wrist = pose(posed["objectFromWrist"])
        # For hands, the wrist in the client's frame counts.
        if "clientFromWrist" in hand:
            without = {key: value for key, value in hand.items() if key != "objectFromWrist"}
            wrist = pose(hand_in_object(without, holdout.convention, client_from_object)["objectFromWrist"])
        rig = client.call("HandRigService/GetRig", {"name": posed["rig"]})
        return posed["handedness"], [joint and axes.composed(wrist, joint) for joint in joints_of(rig, posed)]
    if hand := giver.get("joints"):
        object_from_client = axes.inverse(client_from_object)
        found = joints(hand, holdout.convention)
        return hand["handedness"], [joint and axes.composed(object_from_client, joint) for joint in found]
    return None, []


def _read(path):
    try:
        return json.loads(pathlib.Path(path).read_text())
    except (OSError, ValueError) as error:
        raise GraspError("invalid_argument", f"{path}: {error}") from None
