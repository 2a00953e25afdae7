"""Finds hand poses with which a virtual character takes an object out of a person's hand: the client of the Grasp service.

    with grasp.Client("localhost:50051") as client:
        result = client.find("objects/scissors", budget=0.05)
        if result.grasp:
            print(result.grasp.client_from_wrist, result.grasp.joints.positions)

Poses are 4x4 numpy matrices that map points, `a_from_b @ [x, y, z, 1]`, or pairs of a position and a quaternion x, y, z, w. Frames
are right-handed, +Y up, in meters, unless `convention` names another engine's. Times are in seconds.
"""

from . import conventions, methods, v1
from .aio import AsyncClient
from .aio_track import AsyncTrack
from .client import Client
from .errors import (
    Aborted,
    AlreadyExists,
    Cancelled,
    DataLoss,
    DeadlineExceeded,
    FailedPrecondition,
    GraspError,
    Internal,
    InvalidArgument,
    NotFound,
    OutOfRange,
    PermissionDenied,
    ResourceExhausted,
    Unauthenticated,
    Unavailable,
    Unimplemented,
    Unknown,
    Violation,
)
from .kinematics import digit_angles, hand_joints, posed_joints
from .packed import PackedGrasp
from .poses import Joints, matrix, matrix_from_quaternion, pose_message, quaternion_from_matrix
from .requests import (
    CreateOptions,
    EvaluateOptions,
    FindOptions,
    PushOptions,
    StreamOptions,
    TrackOptions,
    ValidateOptions,
    box,
    half_space,
    tube,
)
from .results import FindResult, Grasp, TrackAnswer
from .retry import RetryPolicy
from .track import Track

__all__ = [
    "Aborted",
    "AlreadyExists",
    "AsyncClient",
    "AsyncTrack",
    "Cancelled",
    "Client",
    "CreateOptions",
    "DataLoss",
    "DeadlineExceeded",
    "EvaluateOptions",
    "FailedPrecondition",
    "FindOptions",
    "FindResult",
    "Grasp",
    "GraspError",
    "Internal",
    "InvalidArgument",
    "Joints",
    "NotFound",
    "OutOfRange",
    "PackedGrasp",
    "PermissionDenied",
    "PushOptions",
    "ResourceExhausted",
    "RetryPolicy",
    "StreamOptions",
    "Track",
    "TrackAnswer",
    "TrackOptions",
    "Unauthenticated",
    "Unavailable",
    "Unimplemented",
    "Unknown",
    "ValidateOptions",
    "Violation",
    "box",
    "conventions",
    "digit_angles",
    "half_space",
    "hand_joints",
    "matrix",
    "matrix_from_quaternion",
    "methods",
    "pose_message",
    "posed_joints",
    "quaternion_from_matrix",
    "tube",
    "v1",
]
