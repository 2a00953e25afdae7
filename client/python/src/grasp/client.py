"""The client that waits for its answers."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Sequence
from types import TracebackType
from typing import Any, TypeVar

import grpc
from typing_extensions import Self, Unpack

from . import methods, requests, v1
from .methods import Method, Request, Response
from .poses import Joints, Side
from .requests import Mesh, Prepared
from .results import FindResult, Grasp
from .retry import Attempts, RetryPolicy
from .track import Track

T = TypeVar("T")

#: Retries are the client's own.
CHANNEL_OPTIONS = [("grpc.enable_retries", 0)]


class Client:
    """A client of a Grasp server. Threads may share it.

    Calls raise a `GraspError`, such as `InvalidArgument` with everything that is wrong with the request, and are repeated as the
    retry policy says while the server is `Unavailable`.

    Args:
        target: host and port, or as gRPC names servers otherwise: "localhost:50051", "unix:/run/grasp.sock".
        credentials: for TLS, such as `grpc.ssl_channel_credentials()`. By default, the connection is not encrypted.
        timeout: seconds until a call fails, retries included; the budget of a search is added.
        retry: when calls are repeated.
    """

    def __init__(
        self,
        target: str,
        *,
        credentials: grpc.ChannelCredentials | None = None,
        timeout: float = 10.0,
        retry: RetryPolicy = RetryPolicy(),
    ) -> None:
        if credentials is None:
            self._channel = grpc.insecure_channel(target, CHANNEL_OPTIONS)
        else:
            self._channel = grpc.secure_channel(target, credentials, CHANNEL_OPTIONS)
        self._timeout = timeout
        self._retry = retry
        #: The objects that can be held out.
        self.objects = Objects(self)
        #: The rigs of hands.
        self.rigs = Rigs(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection and all calls."""
        self._channel.close()

    def find(self, object: str, **options: Unpack[requests.FindOptions]) -> FindResult:
        """Searches for a grasp of "objects/…", with the options of `FindOptions`. None in time is an answer, not an error."""
        return FindResult(self._call(methods.FIND_GRASP, requests.find(object, options)))

    def stream(self, object: str, **options: Unpack[requests.StreamOptions]) -> Generator[FindResult, None, None]:
        """Yields every better grasp until the budget ends, with the options of `StreamOptions`; last the outcome, without a grasp.

        Closing the generator ends the search.
        """
        return self._stream(methods.STREAM_GRASPS, requests.stream(object, options), FindResult)

    def track(self, object: str, **options: Unpack[requests.TrackOptions]) -> Track:
        """Holds on to a grasp while giver and object move, with the options of `TrackOptions`."""
        message = requests.track(object, options)
        return Track(
            self.call,
            self._channel,
            message,
            options.get("convention"),
            options.get("timeout") or self._timeout,
            self._retry,
        )

    def validate(
        self,
        object: str,
        hand: Grasp | Joints | v1.HandPose | v1.HandJoints,
        **options: Unpack[requests.ValidateOptions],
    ) -> v1.ValidateGraspResponse:
        """Makes every check of a grasp, with the options of `ValidateOptions`."""
        return self._call(methods.VALIDATE_GRASP, requests.validate(object, hand, options))

    def evaluate(self, object: str, **options: Unpack[requests.EvaluateOptions]) -> v1.EvaluateHoldoutResponse:
        """Rates whether and from where an object can be taken, with the options of `EvaluateOptions`."""
        return self._call(methods.EVALUATE_HOLDOUT, requests.evaluate(object, options))

    def call(self, method: Method[Request, Response], request: Request, timeout: float | None = None) -> Response:
        """Sends a message of your own to a method of `grasp.methods` that answers with one message."""
        return self._call(method, Prepared(request, timeout))

    def _call(self, method: Method[Request, Response], prepared: Prepared[Request]) -> Response:
        send = self._channel.unary_unary(method.path, method.request.SerializeToString, method.response.FromString)
        return self._repeat(prepared, lambda left: send(prepared.message, timeout=left))

    def _repeat(self, prepared: Prepared[Any], send: Callable[[float | None], T]) -> T:
        """Sends until there is an answer, within the call's time."""
        attempts = Attempts(self._retry, self._time(prepared))
        while True:
            try:
                return send(attempts.begin())
            except grpc.RpcError as error:
                time.sleep(attempts.wait_after(error))

    def _stream(
        self,
        method: Method[Request, Response],
        prepared: Prepared[Request],
        read: Callable[[Response], T],
        *,
        endless: bool = False,
    ) -> Generator[T, None, None]:
        """Starts a call and returns its messages."""
        open_call = self._channel.unary_stream(
            method.path, method.request.SerializeToString, method.response.FromString
        )
        attempts = Attempts(self._retry, None if endless else self._time(prepared))
        first = open_call(prepared.message, timeout=attempts.begin())

        def messages() -> Generator[T, None, None]:
            call, started = first, False
            while True:
                try:
                    for message in call:
                        started = True
                        yield read(message)
                    return
                except grpc.RpcError as error:
                    wait = attempts.wait_after(error, started=started)
                finally:
                    call.cancel()
                time.sleep(wait)
                call = open_call(prepared.message, timeout=attempts.begin())

        return messages()

    def _time(self, prepared: Prepared[Any]) -> float:
        return self._timeout + prepared.extra if prepared.timeout is None else prepared.timeout


class Objects:
    """Manages objects."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def create(
        self, name: str, mesh: Mesh, *, mass_kg: float, **options: Unpack[requests.CreateOptions]
    ) -> v1.GraspObject:
        """Creates "objects/…" from the path or the bytes of an OBJ, STL, PLY, GLB or glTF file.

        A file of more than 8 MiB, or with `progress`, is sent in pieces: `progress(sent, total)` is called after each of 256 KiB.
        """
        client = self._client
        prepared, parts = requests.create_object(name, mesh, mass_kg, options)
        if parts is None:
            return client._call(methods.CREATE_OBJECT, prepared)
        method = methods.UPLOAD_OBJECT
        send = client._channel.stream_unary(method.path, method.request.SerializeToString, method.response.FromString)
        return client._repeat(prepared, lambda left: send(parts(), timeout=left))

    def get(self, name: str) -> v1.GraspObject:
        """Returns "objects/…"."""
        return self._client.call(methods.GET_OBJECT, v1.GetObjectRequest(name=name))

    def list(self, filter: str = "", order_by: str = "") -> Sequence[v1.GraspObject]:
        """All objects, or those that match a filter such as `labels.level = "kitchen" AND name = "objects/mug*"`."""
        found: list[v1.GraspObject] = []
        request = v1.ListObjectsRequest(filter=filter, order_by=order_by)
        while True:
            page = self._client.call(methods.LIST_OBJECTS, request)
            found += page.objects
            if not page.next_page_token:
                return found
            request.page_token = page.next_page_token

    def delete(self, name: str, *, etag: str = "", allow_missing: bool = False) -> None:
        """Deletes "objects/…", with an etag only in that state."""
        request = v1.DeleteObjectRequest(name=name, etag=etag, allow_missing=allow_missing)
        self._client.call(methods.DELETE_OBJECT, request)

    def mesh(self, name: str) -> bytes:
        """The mesh that searches use, as a GLB in the object's frame."""
        request = Prepared(v1.GetMeshRequest(name=name))
        return b"".join(self._client._stream(methods.GET_MESH, request, lambda part: part.piece))

    def watch(
        self, filter: str = "", *, include_present: bool = False
    ) -> Generator[v1.WatchObjectsResponse, None, None]:
        """Yields changes of objects as they happen, until it is closed; with `include_present`, the present ones first."""
        request = Prepared(v1.WatchObjectsRequest(filter=filter, include_present=include_present))
        return self._client._stream(methods.WATCH_OBJECTS, request, lambda news: news, endless=True)


class Rigs:
    """Manages rigs of hands."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def create(
        self, rig_id: str, *models: Mesh, handedness: Side | None = None, timeout: float | None = None
    ) -> v1.HandRig:
        """Creates "rigs/RIG_ID" from the paths or the bytes of GLB, glTF or VRM files with a skinned hand or a character.

        `handedness` is the hand that a model shows if its names do not say.
        """
        return self._client._call(methods.CREATE_RIG, requests.create_rig(rig_id, models, handedness, timeout))

    def get(self, name: str) -> v1.HandRig:
        """Returns "rigs/…"."""
        return self._client.call(methods.GET_RIG, v1.GetRigRequest(name=name))

    def list(self) -> Sequence[v1.HandRig]:
        """All rigs, by name."""
        found: list[v1.HandRig] = []
        request = v1.ListRigsRequest()
        while True:
            page = self._client.call(methods.LIST_RIGS, request)
            found += page.rigs
            if not page.next_page_token:
                return found
            request.page_token = page.next_page_token

    def delete(self, name: str) -> None:
        """Deletes a created rig."""
        self._client.call(methods.DELETE_RIG, v1.DeleteRigRequest(name=name))
