// The part of Grpc.Core.Api, Grpc.Net.Client and YetAnotherHttpHandler that GrpcTransport uses. It only compiles.
using System;
using System.Net.Http;
using System.Threading;
using System.Threading.Tasks;

namespace Grpc.Core
{
    public enum MethodType { Unary }
    public enum StatusCode { OK, InvalidArgument, NotFound, Unavailable }

    public struct Status { public string Detail { get { return ""; } } }

    public sealed class Metadata
    {
        public byte[] GetValueBytes(string key) { throw new NotSupportedException(); }
    }

    public sealed class RpcException : Exception
    {
        public StatusCode StatusCode { get { return StatusCode.OK; } }
        public Status Status { get { return new Status(); } }
        public Metadata Trailers { get { return null; } }
    }

    public sealed class Marshaller<T> { }

    public static class Marshallers
    {
        public static Marshaller<T> Create<T>(Func<T, byte[]> serializer, Func<byte[], T> deserializer) { return null; }
    }

    public sealed class Method<TRequest, TResponse>
    {
        public Method(MethodType type, string service, string name, Marshaller<TRequest> request, Marshaller<TResponse> response) { }
    }

    public struct CallOptions
    {
        public CallOptions(Metadata headers = null, DateTime? deadline = null, CancellationToken cancellationToken = default(CancellationToken)) { }
    }

    public sealed class AsyncUnaryCall<T> : IDisposable
    {
        public Task<T> ResponseAsync { get { return null; } }
        public void Dispose() { }
    }

    public abstract class CallInvoker
    {
        public abstract AsyncUnaryCall<TResponse> AsyncUnaryCall<TRequest, TResponse>(
            Method<TRequest, TResponse> method, string host, CallOptions options, TRequest request)
            where TRequest : class
            where TResponse : class;
    }
}

namespace Grpc.Net.Client
{
    public sealed class GrpcChannelOptions
    {
        public HttpMessageHandler HttpHandler { get; set; }
        public bool DisposeHttpClient { get; set; }
    }

    public sealed class GrpcChannel : IDisposable
    {
        public static GrpcChannel ForAddress(string address, GrpcChannelOptions options) { throw new NotSupportedException(); }
        public Core.CallInvoker CreateCallInvoker() { throw new NotSupportedException(); }
        public void Dispose() { }
    }
}

namespace Cysharp.Net.Http
{
    public sealed class YetAnotherHttpHandler : HttpClientHandler
    {
        public bool Http2Only { get; set; }
    }
}
