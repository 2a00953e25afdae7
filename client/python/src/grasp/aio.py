"""The client for asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable, Sequence
from types import TracebackType
from typing import Any, TypeVar

import grpc
import grpc.aio
from typing_extensions import Self, Unpack

from . import methods, requests, v1
from .aio_errors import ServerStatus
from .aio_track import AsyncTrack
from .client import CHANNEL_OPTIONS
from .methods import Method, Request, Response
from .poses import Joints, Side
from .requests import Mesh, Prepared
from .results import FindResult, Grasp
from .retry import Attempts, RetryPolicy

T = TypeVar("T")


class AsyncClient:
    """A `Client` for asyncio, to be made where an event loop runs. Cancelling a call ends its search on the server."""

    def __init__(
        self,
        target: str,
        *,
        credentials: grpc.ChannelCredentials | None = None,
        timeout: float = 10.0,
        retry: RetryPolicy = RetryPolicy(),
    ) -> None:
        if credentials is None:
            self._channel = grpc.aio.insecure_channel(target, CHANNEL_OPTIONS)
        else:
            self._channel = grpc.aio.secure_channel(target, credentials, CHANNEL_OPTIONS)
        self._timeout = timeout
        self._retry = retry
        #: The objects that can be held out.
        self.objects = AsyncObjects(self)
        #: The rigs of hands.
        self.rigs = AsyncRigs(self)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """As `Client.close`."""
        await self._channel.close()

    async def find(self, object: str, **options: Unpack[requests.FindOptions]) -> FindResult:
        """As `Client.find`."""
        return FindResult(await self._call(methods.FIND_GRASP, requests.find(object, options)))

    def stream(self, object: str, **options: Unpack[requests.StreamOptions]) -> AsyncGenerator[FindResult, None]:
        """As `Client.stream`."""
        return self._stream(methods.STREAM_GRASPS, requests.stream(object, options), FindResult)

    def track(self, object: str, **options: Unpack[requests.TrackOptions]) -> AsyncTrack:
        """As `Client.track`."""
        message = requests.track(object, options)
        return AsyncTrack(
            self.call,
            self._channel,
            message,
            options.get("convention"),
            options.get("timeout") or self._timeout,
            self._retry,
        )

    async def validate(
        self,
        object: str,
        hand: Grasp | Joints | v1.HandPose | v1.HandJoints,
        **options: Unpack[requests.ValidateOptions],
    ) -> v1.ValidateGraspResponse:
        """As `Client.validate`."""
        return await self._call(methods.VALIDATE_GRASP, requests.validate(object, hand, options))

    async def evaluate(
        self, object: str, **options: Unpack[requests.EvaluateOptions]
    ) -> v1.EvaluateHoldoutResponse:
        """As `Client.evaluate`."""
        return await self._call(methods.EVALUATE_HOLDOUT, requests.evaluate(object, options))

    async def call(
        self, method: Method[Request, Response], request: Request, timeout: float | None = None
    ) -> Response:
        """As `Client.call`."""
        return await self._call(method, Prepared(request, timeout))

    async def _call(self, method: Method[Request, Response], prepared: Prepared[Request]) -> Response:
        send = self._channel.unary_unary(method.path, method.request.SerializeToString, method.response.FromString)
        return await self._repeat(prepared, lambda left: send(prepared.message, timeout=left))

    async def _repeat(self, prepared: Prepared[Any], send: Callable[[float | None], Awaitable[T]]) -> T:
        """Sends until there is an answer, within the call's time."""
        attempts = Attempts(self._retry, self._time(prepared))
        while True:
            try:
                return await send(attempts.begin())
            except grpc.RpcError as error:
                wait = attempts.wait_after(error)
            await asyncio.sleep(wait)

    def _stream(
        self,
        method: Method[Request, Response],
        prepared: Prepared[Request],
        read: Callable[[Response], T],
        *,
        endless: bool = False,
    ) -> AsyncGenerator[T, None]:
        """Starts a call and returns its messages."""
        open_call = self._channel.unary_stream(
            method.path, method.request.SerializeToString, method.response.FromString
        )
        attempts = Attempts(self._retry, None if endless else self._time(prepared))
        first = open_call(prepared.message, timeout=attempts.begin())

        async def messages() -> AsyncGenerator[T, None]:
            call, started = first, False
            while True:
                try:
                    async for message in call:
                        started = True
                        yield read(message)
                    return
                except grpc.RpcError as error:
                    wait = attempts.wait_after(error, started=started)
                finally:
                    call.cancel()
                await asyncio.sleep(wait)
                call = open_call(prepared.message, timeout=attempts.begin())

        return messages()

    def _time(self, prepared: Prepared[Any]) -> float:
        return self._timeout + prepared.extra if prepared.timeout is None else prepared.timeout


class AsyncObjects:
    """Manages objects."""

    def __init__(self, client: AsyncClient) -> None:
        self._client = client

    async def create(
        self, name: str, mesh: Mesh, *, mass_kg: float, **options: Unpack[requests.CreateOptions]
    ) -> v1.GraspObject:
        """As `Objects.create`."""
        client = self._client
        prepared, parts = requests.create_object(name, mesh, mass_kg, options)
        if parts is None:
            return await client._call(methods.CREATE_OBJECT, prepared)
        method = methods.UPLOAD_OBJECT
        start = client._channel.stream_unary(method.path, method.request.SerializeToString, method.response.FromString)

        async def send(left: float | None) -> v1.GraspObject:
            call = start(parts(), timeout=left)
            status = ServerStatus(call)
            try:
                return await call
            except grpc.aio.AioRpcError as error:
                raise await status.error(error) from None

        return await client._repeat(prepared, send)

    async def get(self, name: str) -> v1.GraspObject:
        """As `Objects.get`."""
        return await self._client.call(methods.GET_OBJECT, v1.GetObjectRequest(name=name))

    async def list(self, filter: str = "", order_by: str = "") -> Sequence[v1.GraspObject]:
        """As `Objects.list`."""
        found: list[v1.GraspObject] = []
        request = v1.ListObjectsRequest(filter=filter, order_by=order_by)
        while True:
            page = await self._client.call(methods.LIST_OBJECTS, request)
            found += page.objects
            if not page.next_page_token:
                return found
            request.page_token = page.next_page_token

    async def delete(self, name: str, *, etag: str = "", allow_missing: bool = False) -> None:
        """As `Objects.delete`."""
        request = v1.DeleteObjectRequest(name=name, etag=etag, allow_missing=allow_missing)
        await self._client.call(methods.DELETE_OBJECT, request)

    async def mesh(self, name: str) -> bytes:
        """As `Objects.mesh`."""
        request = Prepared(v1.GetMeshRequest(name=name))
        pieces = self._client._stream(methods.GET_MESH, request, lambda part: part.piece)
        return b"".join([piece async for piece in pieces])

    def watch(
        self, filter: str = "", *, include_present: bool = False
    ) -> AsyncGenerator[v1.WatchObjectsResponse, None]:
        """As `Objects.watch`."""
        request = Prepared(v1.WatchObjectsRequest(filter=filter, include_present=include_present))
        return self._client._stream(methods.WATCH_OBJECTS, request, lambda news: news, endless=True)


class AsyncRigs:
    """Manages rigs of hands."""

    def __init__(self, client: AsyncClient) -> None:
        self._client = client

    async def create(
        self, rig_id: str, *models: Mesh, handedness: Side | None = None, timeout: float | None = None
    ) -> v1.HandRig:
        """As `Rigs.create`."""
        return await self._client._call(methods.CREATE_RIG, requests.create_rig(rig_id, models, handedness, timeout))

    async def get(self, name: str) -> v1.HandRig:
        """As `Rigs.get`."""
        return await self._client.call(methods.GET_RIG, v1.GetRigRequest(name=name))

    async def list(self) -> Sequence[v1.HandRig]:
        """As `Rigs.list`."""
        found: list[v1.HandRig] = []
        request = v1.ListRigsRequest()
        while True:
            page = await self._client.call(methods.LIST_RIGS, request)
            found += page.rigs
            if not page.next_page_token:
                return found
            request.page_token = page.next_page_token

    async def delete(self, name: str) -> None:
        """As `Rigs.delete`."""
        await self._client.call(methods.DELETE_RIG, v1.DeleteRigRequest(name=name))
