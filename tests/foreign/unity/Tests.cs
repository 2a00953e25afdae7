// Tests of the package: mono Tests.exe proto/golden/grasps.json http://host:port. Prints a line per test; the exit code is the
// number of failures.
using System;
using System.Collections.Concurrent;
using System.Collections.Generic;
using System.IO;
using System.Reflection;
using System.Threading;
using System.Threading.Tasks;
using Google.Protobuf;
using Grasp.V1;
using GraspClient;
using UnityEngine;
using UnityEngine.Networking;
using UnityEngine.XR.Hands;
using Handedness = Grasp.V1.Handedness;
using Pose = UnityEngine.Pose;
using Quaternion = UnityEngine.Quaternion;
using Vector3 = UnityEngine.Vector3;

public static class Tests
{
    static string address;
    static Dictionary<string, object> golden;
    static HandRig rig;
    static readonly List<Pair> Pairs = new List<Pair>();
    static Loop loop;

    sealed class Pair
    {
        public string Name;
        public FindGraspRequest UnityRequest;
        public Grasp.V1.Grasp OpenXr, Unity;
        public bool IsRight { get { return Unity.Hand.Handedness == Handedness.Right; } }
    }

    /// <summary>Runs posted callbacks on this thread, as Unity's main thread does once a frame.</summary>
    sealed class Loop : SynchronizationContext
    {
        readonly ConcurrentQueue<Action> posted = new ConcurrentQueue<Action>();
        public override void Post(SendOrPostCallback callback, object state) { posted.Enqueue(() => callback(state)); }
        public void Frame()
        {
            Action action;
            for (int count = posted.Count; count > 0 && posted.TryDequeue(out action); count--) { action(); }
            Thread.Sleep(5);
        }
        public T Wait<T>(Task<T> task)
        {
            Until(() => task.IsCompleted, "an answer");
            return task.GetAwaiter().GetResult();
        }
        public void Until(Func<bool> done, string what)
        {
            DateTime end = DateTime.UtcNow.AddSeconds(20);
            while (!done())
            {
                Check(DateTime.UtcNow < end, "waited in vain for " + what);
                Frame();
            }
        }
    }

    public static int Main(string[] arguments)
    {
        golden = (Dictionary<string, object>)Json.Read(File.ReadAllText(arguments[0]));
        address = arguments[1];
        rig = Read<HandRig>(((Dictionary<string, object>)golden["rigs"])["rigs/adult"]);
        foreach (Dictionary<string, object> vector in (List<object>)golden["vectors"])
        {
            var pair = new Pair { Name = (string)vector["name"] };
            foreach (Dictionary<string, object> one in (List<object>)vector["conventions"])
            {
                var convention = (string)one["convention"];
                Grasp.V1.Grasp grasp = Read<FindGraspResponse>(one["answer"]).Grasps[0];
                if (convention == "CONVENTION_OPENXR") { pair.OpenXr = grasp; }
                if (convention == "CONVENTION_UNITY")
                {
                    pair.Unity = grasp;
                    pair.UnityRequest = Read<FindGraspRequest>(one["request"]);
                }
            }
            Pairs.Add(pair);
        }
        loop = new Loop();
        SynchronizationContext.SetSynchronizationContext(loop);
        int failures = 0;
        foreach (MethodInfo test in typeof(Tests).GetMethods(BindingFlags.Static | BindingFlags.NonPublic))
        {
            if (!test.Name.StartsWith("Test")) { continue; }
            try
            {
                test.Invoke(null, null);
                Console.WriteLine("passed " + test.Name);
            }
            catch (TargetInvocationException failure)
            {
                failures++;
                Console.WriteLine("FAILED " + test.Name + ": " + failure.InnerException);
            }
        }
        return failures;
    }

    static T Read<T>(object json) { return (T)JsonFields.Fill(json, typeof(T)); }

    static void Check(bool condition, string what)
    {
        if (!condition) { throw new Exception(what); }
    }

    static void Near(Vector3 a, Vector3 b, float most, string what)
    {
        Check((a - b).magnitude <= most, what + ": " + a + " is " + (a - b).magnitude + " from " + b);
    }

    static void Near(Quaternion a, Quaternion b, float most, string what)
    {
        float sign = Quaternion.Dot(a, b) < 0 ? -1 : 1;
        float off = Mathf.Max(
            Mathf.Max(Mathf.Abs(a.x - sign * b.x), Mathf.Abs(a.y - sign * b.y)),
            Mathf.Max(Mathf.Abs(a.z - sign * b.z), Mathf.Abs(a.w - sign * b.w)));
        Check(off <= most, what + ": " + a + " is not " + b);
    }

    static void Near(Pose a, Pose b, float most, string what)
    {
        Near(a.position, b.position, most, what);
        Near(a.rotation, b.rotation, most, what);
    }

    static Pose[] Joints(Pair pair) { return Messages.Joints(pair.Unity.Hand.Joints); }

    static HandSkeleton Skeleton(bool isRight)
    {
        RigHand hand = rig.Hands[isRight ? 1 : 0];
        var min = new float[5][];
        var max = new float[5][];
        for (int i = 0; i < 5; i++)
        {
            min[i] = Messages.Angles(hand.Limits[i].Min);
            max[i] = Messages.Angles(hand.Limits[i].Max);
        }
        return new HandSkeleton(isRight, Messages.Joints(hand.StretchedJoints), min, max);
    }

    static void TestUnitysAnswersAreOpenXrsInOtherAxes()
    {
        Check(Pairs.Count == 12, "there are " + Pairs.Count + " golden vectors");
        foreach (Pair pair in Pairs)
        {
            HandPose unity = pair.Unity.Hand, openXr = pair.OpenXr.Hand;
            Near(Conventions.FlipZ(Messages.Read(unity.ClientFromWrist)), Messages.Read(openXr.ClientFromWrist), 1e-5f, pair.Name);
            Near(Conventions.FlipZ(Messages.Read(unity.ObjectFromWrist)), Messages.Read(openXr.ObjectFromWrist), 1e-5f, pair.Name);
            for (int i = 0; i < HandSkeleton.JointCount; i++)
            {
                Pose expected = Messages.Read(openXr.Joints[Conventions.JointAt(i)].Pose);
                Near(Conventions.FlipZ(Messages.Read(unity.Joints[i].Pose)), expected, 1e-5f, pair.Name + " joint " + i);
            }
            Check(pair.Unity.Contacts.Count == pair.OpenXr.Contacts.Count, pair.Name);
            for (int i = 0; i < pair.Unity.Contacts.Count; i++)
            {
                Contact a = pair.Unity.Contacts[i], b = pair.OpenXr.Contacts[i];
                Near(Conventions.FlipZ(Messages.Read(a.Position)), Messages.Read(b.Position), 1e-5f, pair.Name);
                Near(Conventions.FlipZ(Messages.Read(a.Normal)), Messages.Read(b.Normal), 1e-5f, pair.Name);
                Near(Conventions.FlipZ(Messages.Read(a.Force)), Messages.Read(b.Force), 1e-4f, pair.Name);
            }
        }
    }

    static void TestPackedGraspsAreTheAnswersHands()
    {
        foreach (Pair pair in Pairs)
        {
            PackedGrasp packed = PackedGrasp.Read(pair.Unity.Packed.ToByteArray());
            HandPose hand = pair.Unity.Hand;
            Pose wrist = Messages.Read(hand.ObjectFromWrist);
            Check(packed.Rig == hand.Rig && packed.IsRight == pair.IsRight, pair.Name + ": another hand");
            Check(packed.Scale == (hand.HasScale ? hand.Scale : 1) && packed.Type == (int)pair.Unity.Type, pair.Name);
            Check(packed.Convention == (int)Convention.Unity, pair.Name + ": another convention");
            Near(packed.ObjectFromWrist.position, wrist.position, 5e-4f, pair.Name);
            float dot = Mathf.Abs(Quaternion.Dot(packed.ObjectFromWrist.rotation, wrist.rotation));
            Check(2 * Math.Acos(Math.Min(1, dot)) < Math.PI / 360, pair.Name + ": the wrist is turned");
            var touching = new bool[6];
            foreach (Contact contact in pair.Unity.Contacts) { touching[((int)contact.Digit + 5) % 6] = true; }
            Check(string.Join(",", touching) == string.Join(",", packed.Touching), pair.Name + ": other digits touch");
            var angles = new[] { hand.Thumb, hand.Index, hand.Middle, hand.Ring, hand.Little };
            for (int digit = 0; digit < 5; digit++)
            {
                float[] exact = Messages.Angles(angles[digit]);
                for (int i = 0; i < 4; i++)
                {
                    Check(Math.Abs(exact[i] - packed.Digits[digit][i]) < Math.PI / 360, pair.Name + ": an angle");
                }
            }
            Pose[] wristFromJoints = Skeleton(packed.IsRight).Joints(packed.Digits, packed.Scale);
            Pose[] joints = HandJointPoses.Moved(Messages.Read(hand.ClientFromWrist), wristFromJoints);
            for (int i = 0; i < joints.Length; i++)
            {
                Near(joints[i].position, Joints(pair)[i].position, 5e-4f, pair.Name + " joint " + i);
                Near(joints[i].rotation, Joints(pair)[i].rotation, 5e-3f, pair.Name + " joint " + i);
            }
        }
    }

    static void TestDamagedPackedGraspsAreRefused()
    {
        byte[] whole = Pairs[0].Unity.Packed.ToByteArray();
        for (int length = 0; length < whole.Length; length++)
        {
            var part = new byte[length];
            Array.Copy(whole, part, length);
            try
            {
                PackedGrasp.Read(part);
                Check(false, length + " bytes were read");
            }
            catch (FormatException)
            {
            }
        }
    }

    /// <summary>An avatar with the rig's bones, arms, and axes of its own at each bone, standing somewhere.</summary>
    static Animator Avatar(bool isRight, HandSkeleton skeleton, int seed)
    {
        var random = new System.Random(seed);
        Func<float> any = () => (float)random.NextDouble() * 2 - 1;
        Func<Quaternion> turn = () => Quaternion.Normalize(new Quaternion(any(), any(), any(), any()));
        var animator = new Animator();
        Pose hand = new Pose(new Vector3(0.2f, 1.3f, 0.5f), turn());
        Pose[] joints = HandJointPoses.Moved(hand, skeleton.Stretched());
        var nodes = new Transform[HandSkeleton.JointCount];
        Func<Transform, Vector3, Transform> node = (parent, position) =>
        {
            var made = new Transform { parent = parent };
            made.SetPositionAndRotation(position, turn());
            return made;
        };
        Vector3 elbow = hand.position + turn() * new Vector3(0, 0, 0.25f);
        Transform upper = node(null, elbow + turn() * new Vector3(0, 0, 0.3f));
        Transform lower = node(upper, elbow);
        nodes[0] = node(lower, hand.position);
        int side = isRight ? 1 : 0;
        animator.bones[HumanBodyBones.LeftUpperArm + side] = upper;
        animator.bones[HumanBodyBones.LeftLowerArm + side] = lower;
        animator.bones[HumanBodyBones.LeftHand + side] = nodes[0];
        for (int joint = 2; joint < nodes.Length; joint++)
        {
            nodes[joint] = node(nodes[HandSkeleton.Parent(joint)], joints[joint].position);
        }
        for (int i = 0; i < 15; i++)
        {
            Transform bone = nodes[HandSkeleton.Base[i / 3] + i % 3];
            animator.bones[(HumanBodyBones)((isRight ? 39 : 24) + i)] = bone;
            // Bent at rest.
            Vector3 axis = joints[7].rotation * new Vector3(0.1f, 0, 0);
            bone.rotation = Quaternion.Normalize(new Quaternion(axis.x, axis.y, axis.z, 1)) * bone.rotation;
        }
        return animator;
    }

    static void TestAnAvatarsBonesGoToTheJoints()
    {
        for (int i = 0; i < Pairs.Count; i++)
        {
            Pair pair = Pairs[i];
            HandSkeleton skeleton = Skeleton(pair.IsRight);
            Animator animator = Avatar(pair.IsRight, skeleton, i);
            var hand = new HumanoidHand(animator, pair.IsRight);
            hand.Fit(skeleton);
            Check(hand.Scale == 1, pair.Name + ": the hand has size " + hand.Scale);
            // Where the arm reaches it.
            Vector3 near = hand.Shoulder + new Vector3(0.1f, -0.2f, 0.3f);
            Pose[] joints = Joints(pair);
            joints = HandJointPoses.Moved(new Pose(near - joints[0].position, Quaternion.identity), joints);
            Vector3 elbow = hand.Shoulder + new Vector3(0, -0.3f, -0.1f);
            for (int times = 0; times < 2; times++)
            {
                hand.Apply(joints, elbow);
            }
            int side = pair.IsRight ? 1 : 0;
            Near(animator.bones[HumanBodyBones.LeftHand + side].position, joints[0].position, 1e-4f, pair.Name + " hand");
            for (int bone = 0; bone < 15; bone++)
            {
                int joint = HandSkeleton.Base[bone / 3] + bone % 3;
                Transform node = animator.bones[(HumanBodyBones)((pair.IsRight ? 39 : 24) + bone)];
                Near(node.position, joints[joint].position, 1e-4f, pair.Name + " joint " + joint);
            }
            Vector3 forearm = animator.bones[HumanBodyBones.LeftLowerArm + side].position;
            Check(Vector3.Dot(forearm - hand.Shoulder, elbow - hand.Shoulder) > 0, pair.Name + ": the elbow is on the other side");
            Check(Math.Abs(hand.ForearmLength - 0.25f) < 1e-4f && Math.Abs(hand.UpperArmLength - 0.3f) < 1e-4f, pair.Name);
        }
    }

    static void TestKeyFramesEndAtTheGraspAndKeepBones()
    {
        Pose[] grasp = Joints(Pairs[0]);
        Pose back = new Pose(new Vector3(0, 0, -0.1f), Quaternion.identity);
        Pose[] open = HandJointPoses.Moved(
            new Pose(grasp[0].position + back.position, grasp[0].rotation), Skeleton(Pairs[0].IsRight).Stretched());
        var player = new KeyFramePlayer(new[] { open, grasp }, 0.2f);
        Check(Math.Abs(player.Length - 0.5f) < 1e-3f, "it takes " + player.Length + " s");
        Near(player.At(0)[10].position, open[10].position, 1e-5f, "the start");
        Near(player.At(9)[10].position, grasp[10].position, 1e-5f, "the end");
        for (float time = 0; time < player.Length; time += 0.05f)
        {
            Pose[] now = player.At(time);
            for (int joint = 1; joint < now.Length; joint++)
            {
                int parent = HandSkeleton.Parent(joint);
                float bone = (now[joint].position - now[parent].position).magnitude;
                float exact = (grasp[joint].position - grasp[parent].position).magnitude;
                Check(Math.Abs(bone - exact) < 2e-4f, "bone " + joint + " has " + bone + " m of " + exact);
            }
        }
    }

    static void TestNodesOfAHandModelGoToTheJoints()
    {
        var nodes = new Transform[HandSkeleton.JointCount];
        nodes[0] = new Transform();
        nodes[9] = new Transform { parent = nodes[0] };
        HandJointPoses.Apply(Joints(Pairs[0]), nodes);
        Near(nodes[9].position, Joints(Pairs[0])[9].position, 1e-6f, "the node");
    }

    static XRHandsGiver Tracked(Pair pair)
    {
        var joints = new XRHandJoint[HandSkeleton.JointCount];
        for (int i = 0; i < joints.Length; i++)
        {
            joints[i].pose = Joints(pair)[i];
            joints[i].radius = pair.Unity.Hand.Joints[i].Radius;
        }
        var hand = new XRHand { joints = joints };
        SubsystemManager.Running.Clear();
        SubsystemManager.Running.Add(new XRHandSubsystem { leftHand = hand, rightHand = hand });
        return new XRHandsGiver { origin = new Transform(), isRight = pair.IsRight };
    }

    static void TestATrackedHandIsTheGiversInItsOrder()
    {
        foreach (Pair pair in Pairs)
        {
            HandJoints read = Tracked(pair).Read().Joints;
            Check(read.Handedness == pair.Unity.Hand.Handedness && read.Joints.Count == 26, pair.Name);
            for (int i = 0; i < 26; i++)
            {
                Near(Messages.Read(read.Joints[i].Pose), Joints(pair)[i], 1e-6f, pair.Name);
                Check(read.Joints[i].Radius == pair.Unity.Hand.Joints[i].Radius, pair.Name);
            }
        }
        SubsystemManager.Running.Clear();
        Check(new XRHandsGiver { origin = new Transform() }.Read() == null, "there is a hand without tracking");
    }

    static void TestAServerAnswersAGoldenRequestAsBefore()
    {
        Pair pair = Pairs[3];
        using (var connection = new GraspConnection(address))
        {
            FindGraspResponse answer = loop.Wait(connection.FindGrasp(pair.UnityRequest, CancellationToken.None));
            Pose[] joints = Messages.Joints(answer.Grasps[0].Hand.Joints);
            for (int i = 0; i < joints.Length; i++) { Near(joints[i], Joints(pair)[i], 1e-5f, "joint " + i); }
        }
    }

    static void TestTheFirstCallOfTheReadmeLogsAGrasp()
    {
        Send(new FirstCall(), "Start");
        loop.Until(() => Debug.Logged.Count > 0, "the log");
        Check(((string)Debug.Logged[0]).StartsWith("Found: "), "it logged " + Debug.Logged[0]);
    }

    static void TestErrorsNameEveryWrongField()
    {
        using (var connection = new GraspConnection(address))
        {
            var request = new FindGraspRequest { Holdout = new Holdout { Object = "objects/remote", Scale = 9, MassKg = -1 } };
            try
            {
                loop.Wait(connection.FindGrasp(request, CancellationToken.None));
                Check(false, "a wrong request was answered");
            }
            catch (GraspException error)
            {
                Check(error.Code == "invalid_argument", error.Code);
                string all = string.Join("\n", error.Violations);
                Check(error.Violations.Count == 2 && all.Contains("holdout.scale: ") && all.Contains("holdout.mass_kg: "), all);
            }
        }
        using (var connection = new GraspConnection("http://127.0.0.1:9"))
        {
            try
            {
                loop.Wait(connection.FindGrasp(new FindGraspRequest(), CancellationToken.None));
                Check(false, "nobody answered");
            }
            catch (GraspException error) { Check(error.Code == "unavailable", error.Code); }
        }
    }

    /// <summary>A receiver before Awake, with the remote in front of it.</summary>
    static GraspReceiver Receiver(Pair pair)
    {
        var receiver = new GraspReceiver
        {
            address = address,
            objectName = "objects/remote",
            heldObject = new Transform(),
            importer = MeshImporter.FlipsZ,
            handedness = pair.Unity.Hand.Handedness,
        };
        Holdout holdout = pair.UnityRequest.Holdout;
        Pose pose = Messages.Read(holdout.ClientFromObject);
        receiver.heldObject.SetPositionAndRotation(pose.position, pose.rotation);
        return receiver;
    }

    static void Send(MonoBehaviour behaviour, string message)
    {
        behaviour.GetType().GetMethod(message, BindingFlags.Instance | BindingFlags.NonPublic).Invoke(behaviour, null);
    }

    static void TestAReceiverAsksOnceAndPosesItsAvatar()
    {
        Pair pair = Pairs[0];
        GraspReceiver receiver = Receiver(pair);
        receiver.animator = Avatar(pair.IsRight, Skeleton(pair.IsRight), 7);
        Animator other = Avatar(!pair.IsRight, Skeleton(!pair.IsRight), 8);
        foreach (var bone in other.bones) { receiver.animator.bones[bone.Key] = bone.Value; }
        Transform shoulder = receiver.animator.bones[pair.IsRight ? HumanBodyBones.RightUpperArm : HumanBodyBones.LeftUpperArm];
        shoulder.position = receiver.heldObject.position + new Vector3(0, 0.25f, -0.35f);
        Grasp.V1.Grasp found = null;
        receiver.Grasped += grasp => found = grasp;
        Send(receiver, "Awake");
        Send(receiver, "OnEnable");
        loop.Until(() => found != null, "a grasp");
        Check(found.KeyFrames.Count > 1, "there are no key frames");
        float start = Time.time;
        loop.Until(() => Time.time > start + 1.5f, "the motion");
        receiver.heldObject.position += new Vector3(0, 0.02f, 0);
        Send(receiver, "LateUpdate");
        Pose[] joints = receiver.Joints;
        Pose wrist = Messages.Read(found.Hand.ClientFromWrist);
        Near(joints[0].position, wrist.position + new Vector3(0, 0.02f, 0), 1e-4f, "the wrist, at the object that moved");
        Transform hand = receiver.animator.bones[pair.IsRight ? HumanBodyBones.RightHand : HumanBodyBones.LeftHand];
        Near(hand.position, joints[0].position, 1e-3f, "the hand");
        Transform tip = receiver.animator.bones[pair.IsRight ? HumanBodyBones.RightHand + 25 : HumanBodyBones.LeftHand + 12];
        Check((tip.position - receiver.heldObject.position).magnitude < 0.25f, "the fingers are elsewhere");
        Send(receiver, "OnDisable");
        Send(receiver, "LateUpdate");
        Check(receiver.Joints == null && found == null, "the hand is still there");
    }

    static void TestAReceiverTracksAndEndsItsTrack()
    {
        Pair giver = Pairs[1];
        GraspReceiver receiver = Receiver(Pairs[0]);
        receiver.giver = Tracked(giver);
        receiver.track = true;
        receiver.heldObject.position += new Vector3(0.4f, 0, 0);
        int grasps = 0;
        GraspException failure = null;
        receiver.Grasped += grasp => grasps += grasp == null ? 0 : 1;
        receiver.Failed += error => failure = error;
        Send(receiver, "Awake");
        Send(receiver, "OnEnable");
        loop.Until(() => grasps > 0 || failure != null, "a grasp");
        Check(failure == null, "failed: " + failure);
        for (int frame = 0; frame < 60; frame++)
        {
            receiver.heldObject.position += new Vector3(0.001f, 0, 0);
            loop.Frame();
            Send(receiver, "LateUpdate");
            Check(receiver.Joints != null, "the grasp is gone");
            Vector3 way = receiver.Joints[0].position - receiver.heldObject.position;
            Check(way.magnitude < 0.3f, "the hand stayed behind: " + way);
        }
        Send(receiver, "OnDisable");
        for (int frame = 0; frame < 60; frame++) { loop.Frame(); }
        Check(failure == null, "failed: " + failure);
        string last = UnityWebRequest.Sent[UnityWebRequest.Sent.Count - 1];
        Check(last.EndsWith("DeleteTrack"), "the last call is " + last);
    }
}
