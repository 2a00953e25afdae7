// The part of UnityEngine that the package uses: the mathematics and the hierarchy of transforms work, in Unity's axes.
using System;
using System.Collections.Generic;
using System.Threading;

namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero { get { return new Vector3(); } }
        public static Vector3 up { get { return new Vector3(0, 1, 0); } }
        public static Vector3 right { get { return new Vector3(1, 0, 0); } }
        public float magnitude { get { return (float)Math.Sqrt(Dot(this, this)); } }
        public Vector3 normalized { get { return magnitude > 1e-5f ? this * (1 / magnitude) : zero; } }
        public static float Dot(Vector3 a, Vector3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
        public static Vector3 Cross(Vector3 a, Vector3 b)
        {
            return new Vector3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
        }
        public static Vector3 Lerp(Vector3 a, Vector3 b, float t) { return a + (b - a) * t; }
        public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
        public static Vector3 operator -(Vector3 a, Vector3 b) { return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z); }
        public static Vector3 operator -(Vector3 a) { return a * -1; }
        public static Vector3 operator *(Vector3 a, float s) { return new Vector3(a.x * s, a.y * s, a.z * s); }
        public static Vector3 operator *(float s, Vector3 a) { return a * s; }
        public static bool operator ==(Vector3 a, Vector3 b) { return (a - b).magnitude < 1e-5f; }
        public static bool operator !=(Vector3 a, Vector3 b) { return !(a == b); }
        public override bool Equals(object other) { return other is Vector3 && this == (Vector3)other; }
        public override int GetHashCode() { return 0; }
        public override string ToString() { return "(" + x + ", " + y + ", " + z + ")"; }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion identity { get { return new Quaternion(0, 0, 0, 1); } }
        public static float Dot(Quaternion a, Quaternion b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }
        public static Quaternion Normalize(Quaternion q)
        {
            float s = 1 / (float)Math.Sqrt(Dot(q, q));
            return new Quaternion(q.x * s, q.y * s, q.z * s, q.w * s);
        }
        public static Quaternion Inverse(Quaternion q) { return new Quaternion(-q.x, -q.y, -q.z, q.w); }
        public static Quaternion Slerp(Quaternion a, Quaternion b, float t)
        {
            float dot = Dot(a, b);
            float sign = dot < 0 ? -1 : 1;
            double angle = Math.Acos(Math.Min(1, Math.Abs(dot)));
            float u = 1 - t, v = t;
            if (angle > 1e-4)
            {
                u = (float)(Math.Sin((1 - t) * angle) / Math.Sin(angle));
                v = (float)(Math.Sin(t * angle) / Math.Sin(angle));
            }
            v *= sign;
            return Normalize(new Quaternion(u * a.x + v * b.x, u * a.y + v * b.y, u * a.z + v * b.z, u * a.w + v * b.w));
        }
        public static Quaternion FromToRotation(Vector3 from, Vector3 to)
        {
            Vector3 a = from.normalized, b = to.normalized, c = Vector3.Cross(a, b);
            return Normalize(new Quaternion(c.x, c.y, c.z, 1 + Vector3.Dot(a, b)));
        }
        public static Quaternion LookRotation(Vector3 forward, Vector3 upwards)
        {
            Vector3 z = forward.normalized, x = Vector3.Cross(upwards, z).normalized, y = Vector3.Cross(z, x);
            float trace = x.x + y.y + z.z;
            if (trace > 0)
            {
                return Normalize(new Quaternion(y.z - z.y, z.x - x.z, x.y - y.x, 1 + trace));
            }
            if (x.x >= y.y && x.x >= z.z)
            {
                return Normalize(new Quaternion(1 + x.x - y.y - z.z, x.y + y.x, x.z + z.x, y.z - z.y));
            }
            return y.y >= z.z
                ? Normalize(new Quaternion(x.y + y.x, 1 + y.y - x.x - z.z, y.z + z.y, z.x - x.z))
                : Normalize(new Quaternion(x.z + z.x, y.z + z.y, 1 + z.z - x.x - y.y, x.y - y.x));
        }
        public static Quaternion operator *(Quaternion a, Quaternion b)
        {
            return new Quaternion(
                a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
                a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
                a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z);
        }
        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            Quaternion turned = q * new Quaternion(v.x, v.y, v.z, 0) * Inverse(q);
            return new Vector3(turned.x, turned.y, turned.z);
        }
        public override string ToString() { return "(" + x + ", " + y + ", " + z + ", " + w + ")"; }
    }

    public struct Pose
    {
        public Vector3 position;
        public Quaternion rotation;
        public Pose(Vector3 position, Quaternion rotation) { this.position = position; this.rotation = rotation; }
    }

    public static class Mathf
    {
        public const float PI = (float)Math.PI;
        public static float Abs(float x) { return Math.Abs(x); }
        public static float Sqrt(float x) { return (float)Math.Sqrt(x); }
        public static float Sin(float x) { return (float)Math.Sin(x); }
        public static float Cos(float x) { return (float)Math.Cos(x); }
        public static float Pow(float x, float y) { return (float)Math.Pow(x, y); }
        public static float Round(float x) { return (float)Math.Round(x); }
        public static float Max(float a, float b) { return Math.Max(a, b); }
        public static float Clamp(float x, float min, float max) { return Math.Max(min, Math.Min(max, x)); }
        public static float Clamp01(float x) { return Clamp(x, 0, 1); }
    }

    public class Object { }

    public class Component : Object
    {
        public readonly Transform transform;
        public Component() { transform = this as Transform ?? new Transform(); }
        public T GetComponent<T>() { throw new NotSupportedException(); }
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; }
    }

    public class MonoBehaviour : Behaviour { }

    public class Transform : Component
    {
        readonly List<Transform> children = new List<Transform>();
        Transform above;
        public Transform parent
        {
            get { return above; }
            set { above = value; if (value != null) { value.children.Add(this); } }
        }
        public int childCount { get { return children.Count; } }
        public Transform GetChild(int index) { return children[index]; }
        public Vector3 localPosition;
        public Quaternion localRotation = Quaternion.identity;
        public Vector3 lossyScale = new Vector3(1, 1, 1);
        public Vector3 position
        {
            get { return parent == null ? localPosition : parent.position + parent.rotation * localPosition; }
            set { localPosition = parent == null ? value : Quaternion.Inverse(parent.rotation) * (value - parent.position); }
        }
        public Quaternion rotation
        {
            get { return parent == null ? localRotation : parent.rotation * localRotation; }
            set { localRotation = parent == null ? value : Quaternion.Inverse(parent.rotation) * value; }
        }
        public void SetPositionAndRotation(Vector3 position, Quaternion rotation)
        {
            this.position = position;
            this.rotation = rotation;
        }
    }

    public class Animator : Behaviour
    {
        public readonly Dictionary<HumanBodyBones, Transform> bones = new Dictionary<HumanBodyBones, Transform>();
        public Transform GetBoneTransform(HumanBodyBones bone)
        {
            Transform found;
            return bones.TryGetValue(bone, out found) ? found : null;
        }
    }

    public enum HumanBodyBones
    {
        LeftUpperArm = 13,
        RightUpperArm = 14,
        LeftLowerArm = 15,
        RightLowerArm = 16,
        LeftHand = 17,
        RightHand = 18,
        LeftThumbProximal = 24,
        RightThumbProximal = 39,
    }

    public static class Time
    {
        static readonly System.Diagnostics.Stopwatch Watch = System.Diagnostics.Stopwatch.StartNew();
        public static float time { get { return (float)Watch.Elapsed.TotalSeconds; } }
        public static double timeAsDouble { get { return Watch.Elapsed.TotalSeconds; } }
        public static float realtimeSinceStartup { get { return time; } }
    }

    public static class Debug
    {
        public static readonly List<object> Logged = new List<object>();
        public static void Log(object message) { Logged.Add(message); }
        public static void LogError(object message, Object context) { Console.Error.WriteLine(message); }
    }

    public static class JsonUtility
    {
        public static T FromJson<T>(string json)
        {
            return json == "" ? default(T) : (T)Json.Fill(Json.Read(json), typeof(T));
        }
    }

    public sealed class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string text) { }
    }

    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type type) { }
    }

    public static class SubsystemManager
    {
        public static readonly List<object> Running = new List<object>();
        public static void GetSubsystems<T>(List<T> subsystems)
        {
            subsystems.Clear();
            foreach (object one in Running)
            {
                if (one is T) { subsystems.Add((T)one); }
            }
        }
    }
}

namespace UnityEngine.Scripting
{
    public sealed class PreserveAttribute : Attribute { }
}

namespace UnityEngine.XR.Hands
{
    public enum XRHandJointID { Invalid, Wrist, Palm, ThumbMetacarpal, LittleTip = 26 }

    public static class XRHandJointIDUtility
    {
        public static XRHandJointID FromIndex(int index) { return (XRHandJointID)(index + 1); }
    }

    public struct XRHandJoint
    {
        public Pose? pose;
        public float radius;
        public bool TryGetPose(out Pose pose)
        {
            pose = this.pose ?? new Pose();
            return this.pose.HasValue;
        }
        public bool TryGetRadius(out float radius)
        {
            radius = this.radius;
            return radius > 0;
        }
    }

    public struct XRHand
    {
        public XRHandJoint[] joints;
        public bool isTracked { get { return joints != null; } }
        public XRHandJoint GetJoint(XRHandJointID id) { return joints[(int)id - 1]; }
    }

    public class XRHandSubsystem
    {
        public XRHand leftHand { get; set; }
        public XRHand rightHand { get; set; }
    }
}

namespace UnityEngine.Networking
{
    public sealed class UnityHttpMessageHandler : System.Net.Http.HttpClientHandler { }

    public sealed class UploadHandlerRaw
    {
        public readonly byte[] Data;
        public UploadHandlerRaw(byte[] data) { Data = data; }
    }

    public sealed class DownloadHandlerBuffer
    {
        public DownloadHandlerBuffer() { text = ""; }
        public string text { get; internal set; }
    }

    public sealed class UnityWebRequestAsyncOperation
    {
        public event Action<UnityWebRequestAsyncOperation> completed;
        internal void Complete() { completed(this); }
    }

    /// <summary>Calls back on the thread that sent it, as Unity does.</summary>
    public sealed class UnityWebRequest : IDisposable
    {
        /// <summary>The addresses of all requests.</summary>
        public static readonly List<string> Sent = new List<string>();
        readonly System.Net.HttpWebRequest request;
        public UnityWebRequest(string url, string method)
        {
            this.url = url;
            Sent.Add(url);
            request = (System.Net.HttpWebRequest)System.Net.WebRequest.Create(url);
            request.Method = method;
            request.ServicePoint.Expect100Continue = false;
        }
        public string url { get; private set; }
        public UploadHandlerRaw uploadHandler { get; set; }
        public DownloadHandlerBuffer downloadHandler { get; set; }
        public int timeout { set { request.Timeout = value * 1000; } }
        public long responseCode { get; private set; }
        public string error { get; private set; }
        public void SetRequestHeader(string name, string value)
        {
            if (name == "Content-Type") { request.ContentType = value; } else { request.Headers[name] = value; }
        }
        public void Abort() { request.Abort(); }
        public void Dispose() { }
        public UnityWebRequestAsyncOperation SendWebRequest()
        {
            var operation = new UnityWebRequestAsyncOperation();
            SynchronizationContext context = SynchronizationContext.Current;
            ThreadPool.QueueUserWorkItem(_ =>
            {
                Send();
                context.Post(__ => operation.Complete(), null);
            });
            return operation;
        }
        void Send()
        {
            try
            {
                using (var body = request.GetRequestStream()) { body.Write(uploadHandler.Data, 0, uploadHandler.Data.Length); }
                Read(request.GetResponse());
            }
            catch (System.Net.WebException failure)
            {
                error = failure.Message;
                if (failure.Response != null) { Read(failure.Response); }
            }
        }
        void Read(System.Net.WebResponse response)
        {
            using (response)
            using (var reader = new System.IO.StreamReader(response.GetResponseStream()))
            {
                responseCode = (int)((System.Net.HttpWebResponse)response).StatusCode;
                downloadHandler.text = reader.ReadToEnd();
            }
        }
    }
}
