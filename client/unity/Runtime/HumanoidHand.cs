using UnityEngine;

namespace GraspClient
{
    /// <summary>Poses hand, fingers and arm of a Humanoid avatar. Its bones keep their own axes and lengths: fingers point as the
    /// joints do, whatever the rest pose is.</summary>
    public sealed class HumanoidHand
    {
        readonly Transform upperArm;
        readonly Transform forearm;
        readonly Transform hand;
        readonly Transform[] bones = new Transform[HandSkeleton.JointCount];
        readonly Quaternion restHand;
        readonly Quaternion restFrame;
        readonly float restLength;
        readonly Quaternion[] rest = new Quaternion[HandSkeleton.JointCount];
        readonly Vector3[] restDirection = new Vector3[HandSkeleton.JointCount];
        readonly Quaternion[] jointFromBone = new Quaternion[HandSkeleton.JointCount];
        Quaternion wristFromHand;

        /// <summary>Reads the rest pose: to be made in Awake, while the avatar is in it.</summary>
        /// <param name="animator">Of a Humanoid avatar whose hand has at least index, middle and little finger.</param>
        /// <param name="isRight">True for its right hand.</param>
        public HumanoidHand(Animator animator, bool isRight)
        {
            upperArm = animator.GetBoneTransform(isRight ? HumanBodyBones.RightUpperArm : HumanBodyBones.LeftUpperArm);
            forearm = animator.GetBoneTransform(isRight ? HumanBodyBones.RightLowerArm : HumanBodyBones.LeftLowerArm);
            hand = animator.GetBoneTransform(isRight ? HumanBodyBones.RightHand : HumanBodyBones.LeftHand);
            restHand = hand.rotation;
            int first = (int)(isRight ? HumanBodyBones.RightThumbProximal : HumanBodyBones.LeftThumbProximal);
            for (int i = 0; i < 15; i++)
            {
                int joint = HandSkeleton.Base[i / 3] + i % 3;
                bones[joint] = animator.GetBoneTransform((HumanBodyBones)(first + i));
                if (bones[joint] != null)
                {
                    rest[joint] = bones[joint].rotation;
                    if (bones[joint].childCount > 0)
                    {
                        restDirection[joint] = bones[joint].GetChild(0).position - bones[joint].position;
                    }
                }
            }
            restFrame = Frame(hand.position, bones[7].position, bones[12].position, bones[22].position);
            restLength = (bones[12].position - hand.position).magnitude;
            Scale = 1;
        }

        /// <summary>The avatar's hand over the rig's, in hundredths: Receiver.scale. Known after <see cref="Fit"/>.</summary>
        public float Scale { get; private set; }

        /// <summary>The shoulder, in Unity's world.</summary>
        public Vector3 Shoulder
        {
            get { return upperArm.position; }
        }

        /// <summary>From shoulder to elbow, in meters.</summary>
        public float UpperArmLength
        {
            get { return (forearm.position - upperArm.position).magnitude; }
        }

        /// <summary>From elbow to wrist, in meters.</summary>
        public float ForearmLength
        {
            get { return (hand.position - forearm.position).magnitude; }
        }

        /// <summary>Lays the stretched hand that answers pose over the avatar's. Required before <see cref="Apply"/>.</summary>
        public void Fit(HandSkeleton skeleton)
        {
            Pose[] stretched = skeleton.Stretched();
            Quaternion frame = Frame(
                stretched[0].position, stretched[7].position, stretched[12].position, stretched[22].position);
            Quaternion worldFromWrist = restFrame * Quaternion.Inverse(frame);
            wristFromHand = Quaternion.Inverse(worldFromWrist) * restHand;
            float ratio = restLength / (stretched[12].position - stretched[0].position).magnitude;
            Scale = Mathf.Clamp(Mathf.Round(ratio * 100) / 100, 0.5f, 2);
            Quaternion straight = Quaternion.identity;
            for (int joint = 0; joint < bones.Length; joint++)
            {
                if (bones[joint] == null)
                {
                    continue;
                }
                // A last bone that nothing follows is as straight as the one before it.
                if (restDirection[joint] != Vector3.zero)
                {
                    Vector3 direction = stretched[joint + 1].position - stretched[joint].position;
                    straight = Quaternion.FromToRotation(restDirection[joint], worldFromWrist * direction);
                }
                jointFromBone[joint] =
                    Quaternion.Inverse(worldFromWrist * stretched[joint].rotation) * straight * rest[joint];
            }
        }

        /// <summary>Poses hand and fingers, and the arm so that the hand is at the wrist's joint, as far as it reaches. To be
        /// called in LateUpdate, after the animation.</summary>
        /// <param name="joints">The joints in Unity's world.</param>
        /// <param name="elbow">Where the elbow should be, Grasp.arm; null: it stays in the plane that the animation gives
        /// it.</param>
        public void Apply(Pose[] joints, Vector3? elbow)
        {
            Reach(joints[0].position, elbow ?? forearm.position);
            hand.rotation = joints[0].rotation * wristFromHand;
            for (int joint = 0; joint < bones.Length; joint++)
            {
                if (bones[joint] != null)
                {
                    bones[joint].rotation = joints[joint].rotation * jointFromBone[joint];
                }
            }
        }

        /// <summary>The frame of a hand whose fingers point along its z, with its y to one side of the palm.</summary>
        static Quaternion Frame(Vector3 wrist, Vector3 index, Vector3 middle, Vector3 little)
        {
            Vector3 forward = middle - wrist;
            return Quaternion.LookRotation(forward, Vector3.Cross(forward, little - index));
        }

        /// <summary>Two-bone inverse kinematics.</summary>
        void Reach(Vector3 target, Vector3 elbow)
        {
            Vector3 shoulder = upperArm.position;
            float upper = (forearm.position - shoulder).magnitude;
            float lower = (hand.position - forearm.position).magnitude;
            Vector3 way = target - shoulder;
            float distance = Mathf.Clamp(way.magnitude, Mathf.Abs(upper - lower) + 1e-4f, upper + lower - 1e-4f);
            Vector3 along = way.normalized;
            Vector3 aside = elbow - shoulder;
            aside = (aside - Vector3.Dot(aside, along) * along).normalized;
            if (aside == Vector3.zero)
            {
                aside = Vector3.Cross(along, Mathf.Abs(along.y) < 0.9f ? Vector3.up : Vector3.right).normalized;
            }
            float near = (upper * upper - lower * lower + distance * distance) / (2 * distance);
            float height = Mathf.Sqrt(Mathf.Max(0, upper * upper - near * near));
            Vector3 bend = shoulder + along * near + aside * height;
            upperArm.rotation =
                Quaternion.FromToRotation(forearm.position - shoulder, bend - shoulder) * upperArm.rotation;
            forearm.rotation = Quaternion.FromToRotation(
                hand.position - forearm.position, shoulder + along * distance - forearm.position) * forearm.rotation;
        }
    }
}
