"""Calls of a server by the Connect protocol: JSON over HTTP, with nothing but Python's library."""

import base64
import contextlib
import http.client
import json
import struct
import urllib.error
import urllib.request

# What a call may take longer than its deadline on the server, in seconds.
_ON_THE_WAY = 2.0
_LAST = 2


class GraspError(Exception):
    """A call failed: `code` as in Connect ("unavailable" without a server), `violations` of fields as (path, description)."""

    def __init__(self, code, message, violations=()):
        shown = [f"{field}: {description}" for field, description in violations]
        super().__init__("\n".join(shown or [message]))
        self.code = code
        self.violations = list(violations)


class Client:
    """A server at an address such as "http://[::1]:50051"; each call ends within `timeout` seconds."""

    def __init__(self, address, timeout=10.0):
        self.address = (address if "://" in address else f"http://{address}").rstrip("/")
        self.timeout = timeout

    def call(self, method, request):
        """Calls a unary method such as "GraspService/FindGrasp"; requests and answers are protobuf's JSON."""
        with self._open(method, "application/json", json.dumps(request).encode()) as answer:
            return json.load(answer)

    def stream(self, method, request):
        """Calls a method that streams answers, and yields them."""
        body = json.dumps(request).encode()
        envelope = struct.pack(">BI", 0, len(body)) + body
        with self._open(method, "application/connect+json", envelope) as answer:
            flags = 0
            while not flags & _LAST:
                flags, length = struct.unpack(">BI", answer.read(5))
                message = json.loads(answer.read(length))
                if not flags & _LAST:
                    yield message
            if error := message.get("error"):
                raise _error(error)

    @contextlib.contextmanager
    def _open(self, method, kind, body):
        headers = {"content-type": kind, "connect-protocol-version": "1", "connect-timeout-ms": str(int(1000 * self.timeout))}
        request = urllib.request.Request(f"{self.address}/grasp.v1.{method}", body, headers, method="POST")
        try:
            with urllib.request.urlopen(request, timeout=self.timeout + _ON_THE_WAY) as answer:
                yield answer
        except urllib.error.HTTPError as error:
            try:
                raise _error(json.loads(error.read())) from None
            except (ValueError, AttributeError):
                raise GraspError("unknown", f"{self.address} answers with HTTP status {error.code}") from None
        except OSError as error:
            raise GraspError("unavailable", f"No server at {self.address}: {getattr(error, 'reason', error)}") from None
        except (ValueError, struct.error, http.client.HTTPException) as error:
            raise GraspError("unavailable", f"{self.address} is no Grasp server: {error}") from None


def _error(json):
    """The error of a Connect error message."""
    details = [detail for detail in json.get("details", ()) if detail["type"] == "google.rpc.BadRequest"]
    values = [base64.b64decode(detail["value"] + "==") for detail in details]
    violations = [dict(_texts(violation)) for value in values for _, violation in _texts(value)]
    listed = [tuple(fields.get(number, b"").decode() for number in (1, 2)) for fields in violations]
    return GraspError(json.get("code", "unknown"), json.get("message", "no message"), listed)


def _texts(message):
    """The numbers and bytes of a protobuf message's fields, which all are texts or messages."""
    place = 0

    def varint():
        nonlocal place
        value = shift = 0
        while True:
            byte = message[place]
            place += 1
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7

    while place < len(message):
        number, length = varint() >> 3, varint()
        yield number, message[place : place + length]
        place += length
