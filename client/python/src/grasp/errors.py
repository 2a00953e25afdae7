"""Exceptions, one for each status code, with the standard details that the server attached."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import grpc
from google.protobuf.message import DecodeError
from google.rpc import error_details_pb2, status_pb2

_DETAILS_TRAILER = "grpc-status-details-bin"

Detail = TypeVar("Detail", error_details_pb2.BadRequest, error_details_pb2.ErrorInfo, error_details_pb2.RetryInfo)


@dataclass(frozen=True)
class Violation:
    """A fault in a field of a request."""

    #: The field's path, such as "holdout.client_from_object.position".
    field: str
    #: The fault, with the value and the allowed ones.
    description: str


class GraspError(Exception):
    """A call that failed, after retries."""

    #: The status code.
    code = grpc.StatusCode.UNKNOWN

    def __init__(self, message: str, details: status_pb2.Status | None = None, attempts: int = 1) -> None:
        super().__init__(message)
        #: The server's message, or the transport's.
        self.message = message
        #: Everything that the server attached.
        self.details = status_pb2.Status() if details is None else details
        #: The number of attempts.
        self.attempts = attempts

    @property
    def violations(self) -> list[Violation]:
        """Everything that is wrong with the request."""
        requests = self._unpacked(error_details_pb2.BadRequest)
        return [Violation(v.field, v.description) for request in requests for v in request.field_violations]

    @property
    def reason(self) -> str:
        """The name of an `ErrorReason`, such as "OBJECT_NOT_FOUND"; empty if the server sent none."""
        return next((info.reason for info in self._unpacked(error_details_pb2.ErrorInfo)), "")

    @property
    def retry_after(self) -> float | None:
        """The least time until the call may succeed, in seconds, if the server knows it."""
        infos = self._unpacked(error_details_pb2.RetryInfo)
        return next((info.retry_delay.ToNanoseconds() / 1e9 for info in infos), None)

    def __str__(self) -> str:
        lines = [self.message, *(f"{violation.field}: {violation.description}" for violation in self.violations)]
        if self.attempts > 1:
            lines.append(f"(tried {self.attempts} times)")
        return "\n  ".join(lines)

    def _unpacked(self, kind: type[Detail]) -> Iterator[Detail]:
        for detail in self.details.details:
            message = kind()
            if detail.Unpack(message):
                yield message


class Cancelled(GraspError):
    """The call was ended early."""

    code = grpc.StatusCode.CANCELLED


class Unknown(GraspError):
    """The server or a proxy gave no usable status."""

    code = grpc.StatusCode.UNKNOWN


class InvalidArgument(GraspError):
    """The request is wrong: `violations` has every wrong field."""

    code = grpc.StatusCode.INVALID_ARGUMENT


class DeadlineExceeded(GraspError):
    """No answer came in time; of a track, no frame."""

    code = grpc.StatusCode.DEADLINE_EXCEEDED


class NotFound(GraspError):
    """The object, rig or track does not exist."""

    code = grpc.StatusCode.NOT_FOUND


class AlreadyExists(GraspError):
    """An object or a rig has the name."""

    code = grpc.StatusCode.ALREADY_EXISTS


class PermissionDenied(GraspError):
    """The caller may not do that."""

    code = grpc.StatusCode.PERMISSION_DENIED


class ResourceExhausted(GraspError):
    """The server has too much to do, or a message is too large; `retry_after` says when to try again."""

    code = grpc.StatusCode.RESOURCE_EXHAUSTED


class FailedPrecondition(GraspError):
    """The object or rig does not allow that, such as a built-in one to be changed."""

    code = grpc.StatusCode.FAILED_PRECONDITION


class Aborted(GraspError):
    """The object has another etag."""

    code = grpc.StatusCode.ABORTED


class OutOfRange(GraspError):
    """The message is larger than the server takes."""

    code = grpc.StatusCode.OUT_OF_RANGE


class Unimplemented(GraspError):
    """The server or a gateway does not offer the call."""

    code = grpc.StatusCode.UNIMPLEMENTED


class Internal(GraspError):
    """The server failed; its log says how."""

    code = grpc.StatusCode.INTERNAL


class Unavailable(GraspError):
    """The server cannot be reached, or shuts down."""

    code = grpc.StatusCode.UNAVAILABLE


class DataLoss(GraspError):
    """Saved data of an object or a rig is damaged."""

    code = grpc.StatusCode.DATA_LOSS


class Unauthenticated(GraspError):
    """The caller is not known."""

    code = grpc.StatusCode.UNAUTHENTICATED


_BY_CODE = {kind.code: kind for kind in GraspError.__subclasses__()}


def trailers(error: grpc.RpcError) -> dict[str, Any]:
    """The trailing metadata of a failed call."""
    metadata: Any = error.trailing_metadata() or ()
    return {key: value for key, value in metadata}


def from_rpc(error: grpc.RpcError, attempts: int) -> GraspError:
    """The exception of a call whose last attempt, number `attempts`, failed."""
    details = status_pb2.Status()
    try:
        details.ParseFromString(trailers(error).get(_DETAILS_TRAILER, b""))
    except DecodeError:
        # The message still names the error.
        details.Clear()
    kind = _BY_CODE.get(error.code(), Unknown)
    return kind(error.details() or "", details, attempts)
