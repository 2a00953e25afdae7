"""Tracks: a grasp held on to while giver and object move.

A frame that is pushed while the one before is still on its way takes its place: the latest wins. Frames go over a stream or, past
gateways that have none in both directions, by one call each.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from types import TracebackType
from typing import Protocol

import grpc
from typing_extensions import Self, Unpack

from . import methods, requests, v1
from .errors import DeadlineExceeded, NotFound, Unimplemented
from .methods import Method, Request, Response
from .poses import Convention
from .results import TrackAnswer
from .retry import Attempts, RetryPolicy


class _Call(Protocol):
    def __call__(
        self, method: Method[Request, Response], request: Request, timeout: float | None = None
    ) -> Response: ...


def unanswered(sequence: int) -> DeadlineExceeded:
    """The error of a frame without an answer in time."""
    return DeadlineExceeded(f"frame {sequence} was not answered in time")


def ended() -> NotFound:
    """The error of a frame for a track that the server or `close` has ended."""
    return NotFound("the track has ended")


class Track:
    """A track, which ends with its `with` block or by `close`. Threads may share it. Made by `Client.track`."""

    def __init__(
        self,
        call: _Call,
        channel: grpc.Channel,
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
        self._lock = threading.Lock()
        self._sequence = 0
        self._stream: _Stream | None = None
        #: Of a track by calls.
        self._name = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def push(self, **options: Unpack[requests.PushOptions]) -> TrackAnswer:
        """Sends a frame with the options of `PushOptions`, and waits for its answer; if a later frame overtook it, for that one's.

        A frame that is wrong, as of a hand that has lost tracking, is answered with its violations in `message.warnings`.

        Raises:
            InvalidArgument: the track itself is wrong.
            DeadlineExceeded: there is no answer in time, or no frame came for too long.
        """
        with self._lock:
            self._sequence += 1
            frame = requests.frame(self._sequence, self._convention, options)
        attempts = Attempts(self._retry, self._timeout)
        while not self._name:
            left = attempts.begin()
            stream = self._opened()
            try:
                return TrackAnswer(stream.push(frame, left or 0))
            except grpc.RpcError as error:
                try:
                    wait = attempts.wait_after(error, started=stream.answers_read > 0)
                except Unimplemented:
                    self._name = self._call(methods.CREATE_TRACK, self._message).name
                    break
                time.sleep(wait)
                self._reopen(stream)
        frame.track = self._name
        return TrackAnswer(self._call(methods.PUSH_FRAME, frame, self._timeout))

    def close(self) -> None:
        """Ends the track."""
        if self._stream is not None:
            self._stream.close()
        if self._name:
            try:
                self._call(methods.DELETE_TRACK, v1.DeleteTrackRequest(name=self._name))
            except NotFound:
                # It ended by itself.
                pass

    def _opened(self) -> _Stream:
        with self._lock:
            if self._stream is None:
                self._stream = _Stream(self._channel, self._message)
            return self._stream

    def _reopen(self, failed: _Stream) -> None:
        with self._lock:
            if self._stream is failed:
                self._stream = None


class _Stream:
    """A track's stream, read by a thread of its own."""

    def __init__(self, channel: grpc.Channel, track: v1.Track) -> None:
        self.answers_read = 0
        self._track = track
        self._changed = threading.Condition()
        self._frame: v1.TrackFrame | None = None
        self._answer: v1.TrackAnswer | None = None
        self._failure: Exception | None = None
        method = methods.TRACK_HOLDOUT
        start = channel.stream_stream(method.path, method.request.SerializeToString, method.response.FromString)
        self._call = start(self._frames())
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def push(self, frame: v1.TrackFrame, timeout: float) -> v1.TrackAnswer:
        with self._changed:
            if self._frame is None or self._frame.sequence < frame.sequence:
                self._frame = frame
            self._changed.notify_all()
            is_answered = self._changed.wait_for(lambda: self._failure or self._answer_to(frame), timeout)
            answer = self._answer_to(frame)
            if answer is not None:
                return answer
            raise self._failure if is_answered and self._failure else unanswered(frame.sequence)

    def close(self) -> None:
        self._end(ended())
        self._call.cancel()
        self._reader.join()

    def _answer_to(self, frame: v1.TrackFrame) -> v1.TrackAnswer | None:
        answer = self._answer
        return answer if answer is not None and answer.sequence >= frame.sequence else None

    def _frames(self) -> Iterator[v1.TrackHoldoutRequest]:
        yield v1.TrackHoldoutRequest(track=self._track)
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._frame or self._failure)
                frame, self._frame = self._frame, None
                if frame is None or self._failure:
                    return
                frame.answers_read = self.answers_read
            yield v1.TrackHoldoutRequest(frame=frame)

    def _read(self) -> None:
        failure: Exception = ended()
        try:
            for answer in self._call:
                with self._changed:
                    self._answer = answer
                    self.answers_read += 1
                    self._changed.notify_all()
        except grpc.RpcError as error:
            failure = error
        self._end(failure)

    def _end(self, failure: Exception) -> None:
        with self._changed:
            self._failure = self._failure or failure
            self._changed.notify_all()
