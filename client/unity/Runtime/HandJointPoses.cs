using UnityEngine;

namespace GraspClient
{
    /// <summary>Arithmetic of a hand's 26 joints, in the order of <see cref="HandSkeleton"/>.</summary>
    public static class HandJointPoses
    {
        /// <summary>Joints given in frame b, in frame a.</summary>
        public static Pose[] Moved(Pose aFromB, Pose[] joints)
        {
            var moved = new Pose[joints.Length];
            for (int i = 0; i < joints.Length; i++)
            {
                moved[i] = Conventions.Compose(aFromB, joints[i]);
            }
            return moved;
        }

        /// <summary>Between two poses of one hand: bones keep their lengths.</summary>
        /// <param name="from">The joints at 0.</param>
        /// <param name="to">The joints at 1.</param>
        /// <param name="t">From 0 to 1.</param>
        public static Pose[] Between(Pose[] from, Pose[] to, float t)
        {
            var joints = new Pose[from.Length];
            joints[0] = Between(from[0], to[0], t);
            for (int i = 1; i < from.Length; i++)
            {
                int parent = HandSkeleton.Parent(i);
                Pose before = Conventions.Compose(Conventions.Inverse(from[parent]), from[i]);
                Pose after = Conventions.Compose(Conventions.Inverse(to[parent]), to[i]);
                joints[i] = Conventions.Compose(joints[parent], Between(before, after, t));
            }
            return joints;
        }

        /// <summary>Puts transforms to the joints: a hand model whose nodes have the axes of XR Hands. Null entries are
        /// skipped.</summary>
        public static void Apply(Pose[] joints, Transform[] nodes)
        {
            for (int i = 0; i < joints.Length; i++)
            {
                if (nodes[i] != null)
                {
                    nodes[i].SetPositionAndRotation(joints[i].position, joints[i].rotation);
                }
            }
        }

        static Pose Between(Pose from, Pose to, float t)
        {
            return new Pose(Vector3.Lerp(from.position, to.position, t), Quaternion.Slerp(from.rotation, to.rotation, t));
        }
    }

    /// <summary>Plays key frames: the open hand, the hand at the object, the grasp.</summary>
    public sealed class KeyFramePlayer
    {
        readonly Pose[][] frames;
        readonly float[] times;

        /// <param name="frames">The joints of each key frame, in the object's frame, so that they follow a moving object.</param>
        /// <param name="speed">Of the wrist, in meters per second; the fingers close in at least 0.2 s.</param>
        public KeyFramePlayer(Pose[][] frames, float speed)
        {
            this.frames = frames;
            times = new float[frames.Length];
            for (int i = 1; i < frames.Length; i++)
            {
                float way = (frames[i][0].position - frames[i - 1][0].position).magnitude;
                times[i] = times[i - 1] + Mathf.Max(way / speed, 0.2f);
            }
        }

        /// <summary>The time of the grasp, in seconds from the start.</summary>
        public float Length
        {
            get { return times[times.Length - 1]; }
        }

        /// <summary>The joints at a time in seconds from the start, in the object's frame.</summary>
        public Pose[] At(float time)
        {
            for (int i = 1; i < frames.Length; i++)
            {
                if (time < times[i])
                {
                    float t = Mathf.Clamp01((time - times[i - 1]) / (times[i] - times[i - 1]));
                    return HandJointPoses.Between(frames[i - 1], frames[i], t);
                }
            }
            return frames[frames.Length - 1];
        }
    }
}
