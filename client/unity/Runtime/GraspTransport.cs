using System;
using System.Threading;
using System.Threading.Tasks;
using Google.Protobuf;

namespace GraspClient
{
    /// <summary>Makes unary calls.</summary>
    public abstract class GraspTransport : IDisposable
    {
        /// <summary>Calls a method and returns its answer.</summary>
        /// <param name="method">Such as "grasp.v1.GraspService/FindGrasp".</param>
        /// <exception cref="GraspException">The call failed.</exception>
        /// <exception cref="OperationCanceledException"><paramref name="cancel"/> was signalled.</exception>
        public abstract Task<TAnswer> Call<TRequest, TAnswer>(
            string method, TRequest request, TimeSpan deadline, CancellationToken cancel)
            where TRequest : class, IMessage<TRequest>
            where TAnswer : class, IMessage<TAnswer>, new();

        /// <summary>Ends calls in flight and closes connections.</summary>
        public abstract void Dispose();

        /// <summary>Opens the best transport of this build: gRPC over YetAnotherHttpHandler or, from Unity 6000.5 on and with TLS,
        /// over Unity's own handler; elsewhere, as in WebGL, the Connect protocol in JSON.</summary>
        /// <param name="address">Such as "http://127.0.0.1:50051", or "https://…".</param>
        public static GraspTransport Open(string address)
        {
#if GRASP_GRPC && UNITY_6000_5_OR_NEWER && (!UNITY_WEBGL || UNITY_EDITOR)
            if (address.StartsWith("https:", StringComparison.Ordinal))
            {
                return new GrpcTransport(address, new UnityEngine.Networking.UnityHttpMessageHandler());
            }
#endif
#if GRASP_GRPC && GRASP_YETANOTHERHTTPHANDLER && (!UNITY_WEBGL || UNITY_EDITOR)
            return new GrpcTransport(address, new Cysharp.Net.Http.YetAnotherHttpHandler { Http2Only = true });
#else
            return new ConnectTransport(address);
#endif
        }
    }
}
