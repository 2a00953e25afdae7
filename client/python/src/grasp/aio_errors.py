"""The true status of calls for asyncio that send streams.

If the server ends such a call while the client sends, grpc.aio reports an internal error from its core in place of the server's status,
before or after that arrives (https://github.com/grpc/grpc/issues/36066).
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

import grpc
import grpc.aio

T = TypeVar("T")

_CORE_FAILURE = "Internal error from Core"

#: How often to look for the server's status, and seconds between: it is on its way.
_LOOKS, _PAUSE = 50, 0.002


class ServerStatus:
    """Remembers each status that a call gets."""

    def __init__(self, call: grpc.aio.Call) -> None:
        self._heard: list[grpc.aio.AioRpcError] = []
        call.add_done_callback(lambda _: self._hear(call))

    async def error(self, error: grpc.aio.AioRpcError) -> grpc.aio.AioRpcError:
        """The error by which the server ended the call that failed with `error`."""
        if error.details() != _CORE_FAILURE:
            return error
        for _ in range(_LOOKS):
            for heard in self._heard:
                if heard.details() != _CORE_FAILURE:
                    return heard
            await asyncio.sleep(_PAUSE)
        return error

    def _hear(self, call: grpc.aio.Call) -> None:
        # The next status replaces this one before a task could read it.
        code, details, trailers = _at_once(call.code()), _at_once(call.details()), _at_once(call.trailing_metadata())
        self._heard.append(grpc.aio.AioRpcError(code, grpc.aio.Metadata(), trailers, details))


def _at_once(known: Coroutine[Any, Any, T]) -> T:
    """The result of a coroutine that has nothing to wait for."""
    try:
        known.send(None)
    except StopIteration as finished:
        result: T = finished.value
        return result
    raise RuntimeError("the status of a call that is done is not known")
