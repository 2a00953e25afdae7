#if GRASP_GRPC
using System;
using System.Collections.Generic;
using System.Net.Http;
using System.Text.RegularExpressions;
using System.Threading;
using System.Threading.Tasks;
using Google.Protobuf;
using Grpc.Core;
using Grpc.Net.Client;

namespace GraspClient
{
    /// <summary>gRPC over an HTTP/2 handler.</summary>
    public sealed class GrpcTransport : GraspTransport
    {
        readonly GrpcChannel channel;
        readonly CallInvoker invoker;

        /// <param name="handler">Is disposed with the transport.</param>
        public GrpcTransport(string address, HttpMessageHandler handler)
        {
            var options = new GrpcChannelOptions { HttpHandler = handler, DisposeHttpClient = true };
            channel = GrpcChannel.ForAddress(address, options);
            invoker = channel.CreateCallInvoker();
        }

        public override async Task<TAnswer> Call<TRequest, TAnswer>(
            string method, TRequest request, TimeSpan deadline, CancellationToken cancel)
        {
            string[] names = method.Split('/');
            var call = new Method<TRequest, TAnswer>(
                MethodType.Unary, names[0], names[1], Marshaller<TRequest>(null), Marshaller(() => new TAnswer()));
            var options = new CallOptions(null, DateTime.UtcNow + deadline, cancel);
            // Disposed at once when it ends: a cancellation alone may not reach the server.
            using (AsyncUnaryCall<TAnswer> unary = invoker.AsyncUnaryCall(call, null, options, request))
            {
                try
                {
                    return await unary.ResponseAsync;
                }
                catch (RpcException error)
                {
                    cancel.ThrowIfCancellationRequested();
                    byte[] status = error.Trailers.GetValueBytes("grpc-status-details-bin");
                    string code = Regex.Replace(error.StatusCode.ToString(), "(?<=[a-z])[A-Z]", "_$0").ToLowerInvariant();
                    throw new GraspException(code, error.Status.Detail, GraspException.DetailsOf(status ?? new byte[0]));
                }
            }
        }

        public override void Dispose()
        {
            channel.Dispose();
        }

        static Marshaller<T> Marshaller<T>(Func<T> create)
            where T : class, IMessage<T>
        {
            return Marshallers.Create(
                message => message.ToByteArray(),
                bytes =>
                {
                    T message = create();
                    message.MergeFrom(bytes);
                    return message;
                });
        }
    }
}
#endif
