using UnityEngine;

namespace GraspClient
{
    /// <summary>Converts between OpenXR's axes (right-handed, +Y up) and Unity's (left-handed, +Y up, +Z forward), both in meters.
    /// Answers in CONVENTION_UNITY or CONVENTION_UNITY_FLIP_X are in Unity's axes already. Each conversion is its own
    /// inverse.</summary>
    public static class Conventions
    {
        /// <summary>A point, a direction or a force in the other axes.</summary>
        public static Vector3 FlipZ(Vector3 v)
        {
            return new Vector3(v.x, v.y, -v.z);
        }

        /// <summary>An orientation in the other axes.</summary>
        public static Quaternion FlipZ(Quaternion q)
        {
            return new Quaternion(-q.x, -q.y, q.z, q.w);
        }

        /// <summary>A pose in the other axes.</summary>
        public static Pose FlipZ(Pose pose)
        {
            return new Pose(FlipZ(pose.position), FlipZ(pose.rotation));
        }

        /// <summary>The index in OpenXR's order of a joint in that of XR Hands, and back: wrist and palm change places.</summary>
        public static int JointAt(int index)
        {
            return index < 2 ? 1 - index : index;
        }

        /// <summary>The pose of b in frame a of <paramref name="aFromB"/>, applied to <paramref name="bFromC"/>.</summary>
        public static Pose Compose(Pose aFromB, Pose bFromC)
        {
            return new Pose(aFromB.position + aFromB.rotation * bFromC.position, aFromB.rotation * bFromC.rotation);
        }

        /// <summary>The pose of a in frame b.</summary>
        public static Pose Inverse(Pose aFromB)
        {
            Quaternion bFromA = Quaternion.Inverse(aFromB.rotation);
            return new Pose(bFromA * -aFromB.position, bFromA);
        }
    }
}
