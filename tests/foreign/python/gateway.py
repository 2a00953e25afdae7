"""A gateway that passes single calls on, has no streams in both directions, and fails when told to."""

import contextlib
from concurrent import futures

import grpc
from google.rpc import error_details_pb2, status_pb2


class Gateway(grpc.GenericRpcHandler):
    def __init__(self, target):
        self.channel = grpc.insecure_channel(target)
        #: The calls that came.
        self.methods = []
        #: Codes of the next calls, retry delays in seconds, and trailers.
        self.failures = []

    def service(self, details):
        self.methods.append(details.method.rsplit("/")[-1])
        if details.method.endswith("TrackHoldout"):
            return None

        def answer(request, context):
            if self.failures:
                code, delay, trailers = self.failures.pop(0)
                status = status_pb2.Status(code=code.value[0])
                info = error_details_pb2.RetryInfo()
                info.retry_delay.FromMilliseconds(round(delay * 1000))
                status.details.add().Pack(info)
                context.set_trailing_metadata((("grpc-status-details-bin", status.SerializeToString()), *trailers))
                context.abort(code, "as told")
            return self.channel.unary_unary(details.method)(request, timeout=context.time_remaining())

        return grpc.unary_unary_rpc_method_handler(answer)


@contextlib.contextmanager
def gateway_to(target):
    """A gateway to the server at the target, and its address."""
    gateway = Gateway(target)
    server = grpc.server(futures.ThreadPoolExecutor(4))
    server.add_generic_rpc_handlers([gateway])
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    yield gateway, f"127.0.0.1:{port}"
    server.stop(0).wait()
    gateway.channel.close()
