"""Tracks for asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Protocol

import grpc
import grpc.aio
from typing_extensions import Self, Unpack

from . import methods, requests, v1
from .aio_errors import ServerStatus
from .errors import NotFound, Unimplemented
from .methods import Method, Request, Response
from .poses import Convention
from .results import TrackAnswer
from .retry import Attempts, RetryPolicy
from .track import ended, unanswered


class _Call(Protocol):
    async def __call__(
        self, method: Method[Request, Response], request: Request, timeout: float | None = None
    ) -> Response: ...


class AsyncTrack:
    """A track, which ends with its `async with` block or by `close`. Tasks may share it. Made by `AsyncClient.track`."""

    def __init__(
        self,
        call: _Call,
        channel: grpc.aio.Channel,
        message: v1.Track,
        convention: Convention | None,
        timeout: float,
        retry: RetryPolicy,
    ) -> None:
        self._call = call
        self._channel = channel
        self._message = message
        self._convention: Convention | None = convention
        self._timeout = timeout
        self._retry = retry
        self._sequence = 0
        self._stream: _Stream | None = None
        #: Of a track by calls.
        self._name = ""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def push(self, **options: Unpack[requests.PushOptions]) -> TrackAnswer:
        """As `Track.push`."""
        self._sequence += 1
        frame = requests.frame(self._sequence, self._convention, options)
        attempts = Attempts(self._retry, self._timeout)
        while not self._name:
            left = attempts.begin()
            stream = self._stream = self._stream or _Stream(self._channel, self._message)
            try:
                return TrackAnswer(await stream.push(frame, left or 0))
            except grpc.RpcError as error:
                try:
                    wait = attempts.wait_after(error, started=stream.answers_read > 0)
                except Unimplemented:
                    self._name = (await self._call(methods.CREATE_TRACK, self._message)).name
                    break
            await asyncio.sleep(wait)
            if self._stream is stream:
                self._stream = None
        frame.track = self._name
        return TrackAnswer(await self._call(methods.PUSH_FRAME, frame, self._timeout))

    async def close(self) -> None:
        """Ends the track."""
        if self._stream is not None:
            await self._stream.close()
        if self._name:
            try:
                await self._call(methods.DELETE_TRACK, v1.DeleteTrackRequest(name=self._name))
            except NotFound:
                # It ended by itself.
                pass


class _Stream:
    """A track's stream, read by a task of its own."""

    def __init__(self, channel: grpc.aio.Channel, track: v1.Track) -> None:
        self.answers_read = 0
        self._track = track
        self._changed = asyncio.Condition()
        self._frame: v1.TrackFrame | None = None
        self._answer: v1.TrackAnswer | None = None
        self._failure: Exception | None = None
        method = methods.TRACK_HOLDOUT
        start = channel.stream_stream(method.path, method.request.SerializeToString, method.response.FromString)
        self._call = start(self._frames())
        self._status = ServerStatus(self._call)
        self._reader = asyncio.create_task(self._read())

    async def push(self, frame: v1.TrackFrame, timeout: float) -> v1.TrackAnswer:
        async with self._changed:
            if self._frame is None or self._frame.sequence < frame.sequence:
                self._frame = frame
            self._changed.notify_all()
            waiting = self._changed.wait_for(lambda: self._failure or self._answer_to(frame))
            try:
                await asyncio.wait_for(waiting, timeout)
            except asyncio.TimeoutError:
                raise unanswered(frame.sequence) from None
            answer = self._answer_to(frame)
            if answer is not None:
                return answer
            raise self._failure or ended()

    async def close(self) -> None:
        await self._end(ended())
        self._call.cancel()
        await self._reader

    def _answer_to(self, frame: v1.TrackFrame) -> v1.TrackAnswer | None:
        answer = self._answer
        return answer if answer is not None and answer.sequence >= frame.sequence else None

    async def _frames(self) -> AsyncIterator[v1.TrackHoldoutRequest]:
        yield v1.TrackHoldoutRequest(track=self._track)
        while True:
            async with self._changed:
                await self._changed.wait_for(lambda: self._frame or self._failure)
                frame, self._frame = self._frame, None
                if frame is None or self._failure:
                    return
                frame.answers_read = self.answers_read
            yield v1.TrackHoldoutRequest(frame=frame)

    async def _read(self) -> None:
        failure: Exception = ended()
        try:
            async for answer in self._call:
                async with self._changed:
                    self._answer = answer
                    self.answers_read += 1
                    self._changed.notify_all()
        except grpc.aio.AioRpcError as error:
            failure = await self._status.error(error)
        except asyncio.CancelledError:
            # By close.
            pass
        await self._end(failure)

    async def _end(self, failure: Exception) -> None:
        async with self._changed:
            self._failure = self._failure or failure
            self._changed.notify_all()
