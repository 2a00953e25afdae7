using System;
using System.Threading;
using System.Threading.Tasks;
using Grasp.V1;
using UnityEngine;
using Pose = UnityEngine.Pose;

namespace GraspClient
{
    /// <summary>Where the importer of the held object's mesh puts (x, y, z) of the file.</summary>
    public enum MeshImporter
    {
        /// <summary>(-x, y, z): glTFast, UnityGLTF, UniVRM for VRM 1.0, Unity's own of OBJ and FBX.</summary>
        FlipsX,

        /// <summary>(x, y, -z): UniGLTF, UniVRM for VRM 0.x.</summary>
        FlipsZ,
    }

    /// <summary>A character that takes an object out of a person's hand: asks for a grasp when enabled, or tracks the holdout while
    /// enabled, and poses hand and arm. Its character may move; the hand stays at the object.</summary>
    public sealed class GraspReceiver : MonoBehaviour
    {
        const float RetryAfter = 1;

        [Tooltip("The server: http://host:port, or https://host:port.")]
        public string address = "http://127.0.0.1:50051";

        [Tooltip("The object's name on the server.")]
        public string objectName = "objects/scissors";

        [Tooltip("The object in the scene, with the mesh that was imported from the same file.")]
        public Transform heldObject;

        [Tooltip("How that mesh was imported.")]
        public MeshImporter importer;

        [Tooltip("The hand to take it with; unspecified: the better one.")]
        public Handedness handedness;

        [Tooltip("The rig of the character's hands.")]
        public string rig = "rigs/adult";

        [Tooltip("The hand that holds the object out; none: nobody does.")]
        public GiverHand giver;

        [Tooltip("The character, a Humanoid; none: only Joints and Grasped tell of the grasp.")]
        public Animator animator;

        [Tooltip("Holds on to a grasp while giver and object move.")]
        public bool track;

        [Tooltip("While tracking: the hand is closing, and is not sent elsewhere any more.")]
        public bool closing;

        [Tooltip("Asks for grasps that can be sent to other players: Grasp.Packed.")]
        public bool packed;

        [Tooltip("How fast the hand goes to the object, in meters per second.")]
        public float speed = 0.8f;

        readonly HumanoidHand[] hands = new HumanoidHand[2];
        CancellationTokenSource running;
        KeyFramePlayer player;
        Pose[] before;
        Pose? elbow;
        int side;
        float since;

        /// <summary>A grasp was found, moved or replaced; null: there is none any more.</summary>
        public event Action<Grasp.V1.Grasp> Grasped;

        /// <summary>A call failed; without a handler, the error is logged.</summary>
        public event Action<GraspException> Failed;

        /// <summary>The hand's joints in Unity's world, in the order of XR Hands, as of the last LateUpdate; null without a
        /// grasp.</summary>
        public Pose[] Joints { get; private set; }

        void Awake()
        {
            if (animator != null)
            {
                hands[0] = new HumanoidHand(animator, false);
                hands[1] = new HumanoidHand(animator, true);
            }
        }

        async void OnEnable()
        {
            running = new CancellationTokenSource();
            CancellationToken cancel = running.Token;
            using (var connection = new GraspConnection(address))
            {
                do
                {
                    try
                    {
                        await Run(connection, cancel);
                        return;
                    }
                    catch (OperationCanceledException)
                    {
                        return;
                    }
                    catch (GraspException error)
                    {
                        Report(error);
                        // A request that is wrong stays wrong; a server that was restarted has lost the track.
                        if (error.Code == "invalid_argument")
                        {
                            return;
                        }
                    }
                }
                while (await Waited(RetryAfter, cancel));
            }
        }

        void OnDisable()
        {
            running.Cancel();
            if (player != null)
            {
                Show(null, null);
            }
        }

        void LateUpdate()
        {
            if (player == null)
            {
                Joints = null;
                return;
            }
            float time = Time.time - since;
            Pose[] joints = player.At(time);
            const float Blend = 0.15f;
            if (before != null && time < Blend)
            {
                joints = HandJointPoses.Between(before, joints, time / Blend);
            }
            Joints = HandJointPoses.Moved(WorldFromObject, joints);
            if (hands[side] != null)
            {
                Pose? bend = elbow.HasValue ? Conventions.Compose(WorldFromObject, elbow.Value) : (Pose?)null;
                hands[side].Apply(Joints, bend.HasValue ? bend.Value.position : (UnityEngine.Vector3?)null);
            }
        }

        Pose WorldFromObject
        {
            get { return new Pose(heldObject.position, heldObject.rotation); }
        }

        async Task Run(GraspConnection connection, CancellationToken cancel)
        {
            if (animator != null)
            {
                HandSkeleton[] skeletons = await connection.Skeletons(rig, cancel);
                for (int i = 0; i < hands.Length; i++)
                {
                    hands[i].Fit(skeletons[i]);
                }
            }
            if (track)
            {
                await Track(connection, cancel);
            }
            else
            {
                Pose asked = WorldFromObject;
                var request = new FindGraspRequest { Holdout = Holdout(), Receiver = Receiver(), Output = Output() };
                request.Output.KeyFrames = true;
                FindGraspResponse answer = await connection.FindGrasp(request, cancel);
                Show(answer.Grasps.Count > 0 ? answer.Grasps[0] : null, asked);
            }
        }

        async Task Track(GraspConnection connection, CancellationToken cancel)
        {
            var created = new Track { Holdout = new Holdout { Object = objectName }, Receiver = Receiver(), Output = Output() };
            SetScale(created.Holdout);
            created.Output.ChangesOnly = true;
            created = await connection.CreateTrack(created, cancel);
            try
            {
                for (ulong sequence = 1; ; sequence++)
                {
                    Pose asked = WorldFromObject;
                    var frame = new TrackFrame { Track = created.Name, Sequence = sequence, Committed = closing };
                    frame.CaptureTime = Google.Protobuf.WellKnownTypes.Duration.FromTimeSpan(TimeSpan.FromSeconds(Time.timeAsDouble));
                    frame.Holdout = new Holdout { ClientFromObject = Messages.Write(asked), PresentingHand = Giver() };
                    Answered(await connection.PushFrame(frame, cancel), asked);
                    // The next frame of the game at the earliest.
                    await Task.Yield();
                }
            }
            finally
            {
                await Delete(connection, created.Name);
            }
        }

        void Answered(TrackAnswer answer, Pose asked)
        {
            if (answer.Current == null)
            {
                return;
            }
            switch (answer.Current.Status)
            {
                case CurrentGraspStatus.Replanned:
                case CurrentGraspStatus.Adjusted:
                    Show(answer.Grasp, asked);
                    break;
                case CurrentGraspStatus.None:
                    if (player != null)
                    {
                        Show(null, asked);
                    }
                    break;
                case CurrentGraspStatus.Aborted:
                    Show(new Grasp.V1.Grasp { Hand = answer.Current.Withdrawal }, asked);
                    break;
            }
        }

        /// <summary>Ends a track. One that cannot be deleted ends by itself soon after its last frame.</summary>
        static async Task Delete(GraspConnection connection, string track)
        {
            using (var limit = new CancellationTokenSource(TimeSpan.FromSeconds(2)))
            {
                try
                {
                    await connection.DeleteTrack(track, limit.Token);
                }
                catch (GraspException)
                {
                }
                catch (OperationCanceledException)
                {
                }
            }
        }

        /// <summary>Shows a grasp from now on; null: none.</summary>
        /// <param name="asked">The object's pose in the request.</param>
        void Show(Grasp.V1.Grasp grasp, Pose? asked)
        {
            // The hand leaves from where it is, if it is the same one.
            before = player == null ? null : player.At(Time.time - since);
            player = null;
            elbow = null;
            if (grasp != null)
            {
                Pose objectFromWorld = Conventions.Inverse(asked.Value);
                int shown = grasp.Hand.Handedness == Handedness.Right ? 1 : 0;
                before = shown == side ? before : null;
                side = shown;
                var frames = new Pose[Math.Max(1, grasp.KeyFrames.Count)][];
                for (int i = 0; i < frames.Length; i++)
                {
                    HandPose hand = grasp.KeyFrames.Count > 0 ? grasp.KeyFrames[i].Hand : grasp.Hand;
                    frames[i] = HandJointPoses.Moved(objectFromWorld, Messages.Joints(hand.Joints));
                }
                player = new KeyFramePlayer(frames, speed);
                if (grasp.Arm != null)
                {
                    var bend = new Pose(Messages.Read(grasp.Arm.ClientElbow), UnityEngine.Quaternion.identity);
                    elbow = Conventions.Compose(objectFromWorld, bend);
                }
                since = Time.time;
            }
            Grasped?.Invoke(grasp);
        }

        Holdout Holdout()
        {
            var holdout = new Holdout
            {
                Object = objectName,
                ClientFromObject = Messages.Write(WorldFromObject),
                PresentingHand = Giver(),
            };
            SetScale(holdout);
            return holdout;
        }

        void SetScale(Holdout holdout)
        {
            float scale = heldObject.lossyScale.x;
            if (Mathf.Abs(scale - 1) > 0.005f)
            {
                holdout.Scale = scale;
            }
        }

        PresentingHand Giver()
        {
            return giver == null ? null : giver.Read();
        }

        Receiver Receiver()
        {
            var receiver = new Receiver { Rig = rig, Handedness = handedness };
            HumanoidHand hand = hands[handedness == Handedness.Right ? 1 : 0];
            if (hand != null)
            {
                receiver.Scale = hand.Scale;
            }
            if (handedness != Handedness.Unspecified && hand != null)
            {
                receiver.ClientShoulder = Messages.Write(hand.Shoulder);
                receiver.UpperArmLength = hand.UpperArmLength;
                receiver.ForearmLength = hand.ForearmLength;
            }
            return receiver;
        }

        OutputOptions Output()
        {
            bool flipsX = importer == MeshImporter.FlipsX;
            return new OutputOptions { Convention = flipsX ? Convention.UnityFlipX : Convention.Unity, Packed = packed };
        }

        void Report(GraspException error)
        {
            if (Failed != null)
            {
                Failed(error);
            }
            else
            {
                Debug.LogError(error.Code + ": " + error.Message + "\n" + string.Join("\n", error.Violations), this);
            }
        }

        static async Task<bool> Waited(float seconds, CancellationToken cancel)
        {
            float end = Time.realtimeSinceStartup + seconds;
            while (Time.realtimeSinceStartup < end && !cancel.IsCancellationRequested)
            {
                await Task.Yield();
            }
            return !cancel.IsCancellationRequested;
        }
    }
}
