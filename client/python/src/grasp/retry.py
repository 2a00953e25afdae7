"""Retries: on UNAVAILABLE only, with exponential backoff, a bounded number of times, and within the call's time."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass

import grpc

from .errors import GraspError, from_rpc, trailers

#: The trailer with which a server sets the wait or forbids a retry (gRPC proposal A6).
_PUSHBACK_TRAILER = "grpc-retry-pushback-ms"

#: Relative variation of waits in both directions; keeps clients that failed together from retrying together.
_JITTER = 0.2


@dataclass(frozen=True)
class RetryPolicy:
    """Number of attempts of a call, and the waits between them, in seconds."""

    #: Largest number of attempts, the first included; 1 disables retries.
    max_attempts: int = 4
    #: Wait before the second attempt, varied by up to a fifth.
    initial_backoff: float = 0.1
    #: Longest wait, unless the server asks for more.
    max_backoff: float = 2.0
    #: Factor from one wait to the next.
    multiplier: float = 2.0


class Attempts:
    """The attempts of one call."""

    def __init__(self, policy: RetryPolicy, timeout: float | None) -> None:
        self._policy = policy
        self._end = None if timeout is None else time.monotonic() + timeout
        self._count = 0

    def begin(self) -> float | None:
        """Begins the next attempt; returns the seconds left for it, None without a limit."""
        self._count += 1
        return None if self._end is None else max(self._end - time.monotonic(), 0)

    def wait_after(self, error: grpc.RpcError, *, started: bool = False) -> float:
        """Seconds to wait until the next attempt.

        Raises:
            GraspError: there is none; streams that have `started` are not repeated.
        """
        failure = from_rpc(error, self._count)
        wait = None if started else self._wait(failure, trailers(error).get(_PUSHBACK_TRAILER))
        if wait is None or (self._end is not None and time.monotonic() + wait >= self._end):
            raise failure from error
        return wait

    def _wait(self, failure: GraspError, pushback: str | None) -> float | None:
        if failure.code != grpc.StatusCode.UNAVAILABLE or self._count >= self._policy.max_attempts:
            return None
        if pushback is not None:
            # A negative or unreadable value forbids a retry.
            return int(pushback) / 1000 if pushback.isdecimal() else None
        backoff = self._policy.initial_backoff * self._policy.multiplier ** (self._count - 1)
        varied = min(backoff, self._policy.max_backoff) * random.uniform(1 - _JITTER, 1 + _JITTER)
        return max(varied, failure.retry_after or 0)
