"""The methods of the contract, for `Client.call` and `AsyncClient.call`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from google.protobuf.empty_pb2 import Empty
from google.protobuf.message import Message

from . import v1

Request = TypeVar("Request", bound=Message)
Response = TypeVar("Response", bound=Message)


@dataclass(frozen=True)
class Method(Generic[Request, Response]):
    """A method: its path and its messages."""

    path: str
    request: type[Request]
    response: type[Response]


def _path(service: str, method: str) -> str:
    return f"/grasp.v1.{service}/{method}"


FIND_GRASP = Method(_path("GraspService", "FindGrasp"), v1.FindGraspRequest, v1.FindGraspResponse)
STREAM_GRASPS = Method(_path("GraspService", "StreamGrasps"), v1.StreamGraspsRequest, v1.FindGraspResponse)
TRACK_HOLDOUT = Method(_path("GraspService", "TrackHoldout"), v1.TrackHoldoutRequest, v1.TrackAnswer)
CREATE_TRACK = Method(_path("GraspService", "CreateTrack"), v1.Track, v1.Track)
PUSH_FRAME = Method(_path("GraspService", "PushFrame"), v1.TrackFrame, v1.TrackAnswer)
DELETE_TRACK = Method(_path("GraspService", "DeleteTrack"), v1.DeleteTrackRequest, Empty)
VALIDATE_GRASP = Method(_path("GraspService", "ValidateGrasp"), v1.ValidateGraspRequest, v1.ValidateGraspResponse)
EVALUATE_HOLDOUT = Method(
    _path("GraspService", "EvaluateHoldout"), v1.EvaluateHoldoutRequest, v1.EvaluateHoldoutResponse
)

CREATE_OBJECT = Method(_path("ObjectService", "CreateObject"), v1.CreateObjectRequest, v1.GraspObject)
UPLOAD_OBJECT = Method(_path("ObjectService", "UploadObject"), v1.UploadObjectRequest, v1.GraspObject)
GET_OBJECT = Method(_path("ObjectService", "GetObject"), v1.GetObjectRequest, v1.GraspObject)
LIST_OBJECTS = Method(_path("ObjectService", "ListObjects"), v1.ListObjectsRequest, v1.ListObjectsResponse)
UPDATE_OBJECT = Method(_path("ObjectService", "UpdateObject"), v1.UpdateObjectRequest, v1.GraspObject)
DELETE_OBJECT = Method(_path("ObjectService", "DeleteObject"), v1.DeleteObjectRequest, Empty)
GET_MESH = Method(_path("ObjectService", "GetMesh"), v1.GetMeshRequest, v1.GetMeshResponse)
WATCH_OBJECTS = Method(_path("ObjectService", "WatchObjects"), v1.WatchObjectsRequest, v1.WatchObjectsResponse)
GET_ATLAS = Method(_path("ObjectService", "GetAtlas"), v1.GetAtlasRequest, v1.Atlas)

CREATE_RIG = Method(_path("HandRigService", "CreateRig"), v1.CreateRigRequest, v1.HandRig)
GET_RIG = Method(_path("HandRigService", "GetRig"), v1.GetRigRequest, v1.HandRig)
LIST_RIGS = Method(_path("HandRigService", "ListRigs"), v1.ListRigsRequest, v1.ListRigsResponse)
DELETE_RIG = Method(_path("HandRigService", "DeleteRig"), v1.DeleteRigRequest, Empty)
