using System;
using System.Collections.Generic;
using System.Threading;
using System.Threading.Tasks;
using Google.Protobuf;
using Grasp.V1;
using UnityEngine;

// JSON finds the fields of messages by reflection.
[assembly: UnityEngine.Scripting.Preserve]

namespace GraspClient
{
    /// <summary>The calls that a receiving character needs. Any other unary call goes through <see cref="Transport"/>.</summary>
    public sealed class GraspConnection : IDisposable
    {
        static readonly TimeSpan Deadline = TimeSpan.FromSeconds(10);

        /// <summary>The way to the server.</summary>
        public GraspTransport Transport { get; private set; }

        /// <param name="address">Such as "http://127.0.0.1:50051".</param>
        public GraspConnection(string address)
        {
            Transport = GraspTransport.Open(address);
        }

        public Task<FindGraspResponse> FindGrasp(FindGraspRequest request, CancellationToken cancel)
        {
            return Call<FindGraspRequest, FindGraspResponse>("GraspService/FindGrasp", request, cancel);
        }

        public Task<Track> CreateTrack(Track track, CancellationToken cancel)
        {
            return Call<Track, Track>("GraspService/CreateTrack", track, cancel);
        }

        public Task<TrackAnswer> PushFrame(TrackFrame frame, CancellationToken cancel)
        {
            return Call<TrackFrame, TrackAnswer>("GraspService/PushFrame", frame, cancel);
        }

        public Task DeleteTrack(string name, CancellationToken cancel)
        {
            return Call<DeleteTrackRequest, Google.Protobuf.WellKnownTypes.Empty>(
                "GraspService/DeleteTrack", new DeleteTrackRequest { Name = name }, cancel);
        }

        /// <summary>The skeletons of a rig: the left hand's, then the right hand's.</summary>
        public async Task<HandSkeleton[]> Skeletons(string rig, CancellationToken cancel)
        {
            HandRig answer = await Call<GetRigRequest, HandRig>(
                "HandRigService/GetRig", new GetRigRequest { Name = rig }, cancel);
            var skeletons = new HandSkeleton[2];
            foreach (RigHand hand in answer.Hands)
            {
                var min = new float[5][];
                var max = new float[5][];
                foreach (DigitLimits limits in hand.Limits)
                {
                    min[(int)limits.Digit - 1] = Messages.Angles(limits.Min);
                    max[(int)limits.Digit - 1] = Messages.Angles(limits.Max);
                }
                bool isRight = hand.Handedness == Handedness.Right;
                skeletons[isRight ? 1 : 0] = new HandSkeleton(isRight, Messages.Joints(hand.StretchedJoints), min, max);
            }
            return skeletons;
        }

        /// <summary>Closes the connection; calls in flight end.</summary>
        public void Dispose()
        {
            Transport.Dispose();
        }

        Task<TAnswer> Call<TRequest, TAnswer>(string method, TRequest request, CancellationToken cancel)
            where TRequest : class, IMessage<TRequest>
            where TAnswer : class, IMessage<TAnswer>, new()
        {
            return Transport.Call<TRequest, TAnswer>("grasp.v1." + method, request, Deadline, cancel);
        }
    }

    /// <summary>Between messages of the contract and Unity's types. Axes stay as they are.</summary>
    public static class Messages
    {
        public static UnityEngine.Vector3 Read(Grasp.V1.Vector3 v)
        {
            return v == null ? UnityEngine.Vector3.zero : new UnityEngine.Vector3(v.X, v.Y, v.Z);
        }

        public static UnityEngine.Pose Read(Grasp.V1.Pose pose)
        {
            Grasp.V1.Quaternion q = pose?.Orientation;
            return new UnityEngine.Pose(
                Read(pose?.Position),
                q == null ? UnityEngine.Quaternion.identity : new UnityEngine.Quaternion(q.X, q.Y, q.Z, q.W));
        }

        public static Grasp.V1.Vector3 Write(UnityEngine.Vector3 v)
        {
            return new Grasp.V1.Vector3 { X = v.x, Y = v.y, Z = v.z };
        }

        public static Grasp.V1.Pose Write(UnityEngine.Pose pose)
        {
            UnityEngine.Quaternion q = pose.rotation;
            return new Grasp.V1.Pose
            {
                Position = Write(pose.position),
                Orientation = new Grasp.V1.Quaternion { X = q.x, Y = q.y, Z = q.z, W = q.w },
            };
        }

        /// <summary>The poses of joints, in their order.</summary>
        public static UnityEngine.Pose[] Joints(IList<JointPose> joints)
        {
            var poses = new UnityEngine.Pose[joints.Count];
            for (int i = 0; i < poses.Length; i++)
            {
                poses[i] = Read(joints[i].Pose);
            }
            return poses;
        }

        /// <summary>Base yaw, base pitch, second and third pitch.</summary>
        public static float[] Angles(DigitAngles angles)
        {
            float third = angles.HasThirdPitch ? angles.ThirdPitch : angles.SecondPitch * 2 / 3;
            return new[] { angles.BaseYaw, angles.BasePitch, angles.SecondPitch, third };
        }
    }
}
