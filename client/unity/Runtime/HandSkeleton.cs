using UnityEngine;

namespace GraspClient
{
    /// <summary>The bones of one hand of a rig (HandRigService.GetRig), and the joints that they have at given angles.
    /// Joints are in the order of XR Hands, XRHandJointID - 1: wrist, palm, thumb from 2, fingers from 6, 11, 16 and 21. Each
    /// points along +Z to the fingertip, with +Y out of the hand's back.</summary>
    public sealed class HandSkeleton
    {
        /// <summary>Number of joints.</summary>
        public const int JointCount = 26;

        /// <summary>The joint at which a digit bends first, thumb first: its metacarpal, or a finger's proximal joint.</summary>
        public static readonly int[] Base = { 2, 7, 12, 17, 22 };

        readonly bool isRight;
        readonly Pose[] stretched;
        readonly float[][] stretchedAngles;

        /// <param name="isRight">True for a right hand.</param>
        /// <param name="stretchedJoints">RigHand.stretched_joints as they come: OpenXR's axes and order, in the wrist's
        /// frame.</param>
        /// <param name="min">The smallest angles of each digit, thumb first: RigHand.limits; null for a missing one.</param>
        /// <param name="max">The largest angles.</param>
        public HandSkeleton(bool isRight, Pose[] stretchedJoints, float[][] min, float[][] max)
        {
            this.isRight = isRight;
            stretched = stretchedJoints;
            stretchedAngles = new float[5][];
            for (int digit = 0; digit < 5; digit++)
            {
                if (min[digit] == null)
                {
                    continue;
                }
                stretchedAngles[digit] = new float[4];
                for (int i = 0; i < 4; i++)
                {
                    stretchedAngles[digit][i] = Mathf.Clamp(0, min[digit][i], max[digit][i]);
                }
            }
        }

        /// <summary>The joint before <paramref name="joint"/>; the wrist's, 0, is before palm and metacarpals.</summary>
        public static int Parent(int joint)
        {
            return joint < 3 || joint % 5 == 1 ? 0 : joint - 1;
        }

        /// <summary>The stretched hand, in the wrist's frame.</summary>
        public Pose[] Stretched()
        {
            return InUnity(stretched, 1);
        }

        /// <summary>The joints of a hand with the given angles, in the wrist's frame, in meters.</summary>
        /// <param name="digits">As <see cref="PackedGrasp.Digits"/>.</param>
        /// <param name="scale">The hand's size over the rig's.</param>
        public Pose[] Joints(float[][] digits, float scale)
        {
            var posed = (Pose[])stretched.Clone();
            for (int digit = 0; digit < 5; digit++)
            {
                float[] rest = stretchedAngles[digit];
                float[] now = digits[digit];
                if (rest == null || now == null)
                {
                    continue;
                }
                int first = Base[digit];
                for (int i = 0; i < 4; i++)
                {
                    int joint = first + i;
                    Pose parent = i == 0 ? new Pose(Vector3.zero, Quaternion.identity) : stretched[joint - 1];
                    Pose parentNow = i == 0 ? parent : posed[joint - 1];
                    Pose local = Conventions.Compose(Conventions.Inverse(parent), stretched[joint]);
                    if (i == 0)
                    {
                        local.rotation *= Quaternion.Inverse(Bend(digit, rest[0], rest[1])) * Bend(digit, now[0], now[1]);
                    }
                    else if (i < 3)
                    {
                        local.rotation *= About(1, 0, rest[i + 1]) * About(1, 0, -now[i + 1]);
                    }
                    posed[joint] = Conventions.Compose(parentNow, local);
                }
            }
            return InUnity(posed, scale);
        }

        /// <summary>The turn of a base joint: yaw to the little finger's side, or the thumb's lift, then pitch.</summary>
        Quaternion Bend(int digit, float yaw, float pitch)
        {
            return About(0, 1, digit == 0 == isRight ? yaw : -yaw) * About(1, 0, -pitch);
        }

        static Quaternion About(float x, float y, float angle)
        {
            float sin = Mathf.Sin(angle / 2);
            return new Quaternion(x * sin, y * sin, 0, Mathf.Cos(angle / 2));
        }

        static Pose[] InUnity(Pose[] openXr, float scale)
        {
            var joints = new Pose[JointCount];
            for (int i = 0; i < JointCount; i++)
            {
                joints[i] = Conventions.FlipZ(openXr[Conventions.JointAt(i)]);
                joints[i].position *= scale;
            }
            return joints;
        }
    }
}
