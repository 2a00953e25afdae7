#if GRASP_XR_HANDS
using System.Collections.Generic;
using Grasp.V1;
using UnityEngine;
using UnityEngine.XR.Hands;

namespace GraspClient
{
    /// <summary>A giver's hand that XR Hands tracks.</summary>
    public sealed class XRHandsGiver : GiverHand
    {
        [Tooltip("The XR Origin's camera offset: joints are tracked in its frame.")]
        public Transform origin;

        [Tooltip("The hand that holds the object.")]
        public bool isRight = true;

        readonly List<XRHandSubsystem> subsystems = new List<XRHandSubsystem>();

        public override PresentingHand Read()
        {
            SubsystemManager.GetSubsystems(subsystems);
            if (subsystems.Count == 0)
            {
                return null;
            }
            XRHand hand = isRight ? subsystems[0].rightHand : subsystems[0].leftHand;
            return hand.isTracked ? new PresentingHand { Joints = Joints(hand) } : null;
        }

        HandJoints Joints(XRHand hand)
        {
            var message = new HandJoints { Handedness = isRight ? Grasp.V1.Handedness.Right : Grasp.V1.Handedness.Left };
            var worldFromOrigin = new UnityEngine.Pose(origin.position, origin.rotation);
            for (int i = 0; i < HandSkeleton.JointCount; i++)
            {
                XRHandJoint joint = hand.GetJoint(XRHandJointIDUtility.FromIndex(i));
                UnityEngine.Pose pose;
                float radius;
                // One that lost tracking stays empty: the server names it, or in tracks takes where it was last.
                var entry = new JointPose();
                if (joint.TryGetPose(out pose))
                {
                    entry.Pose = Messages.Write(Conventions.Compose(worldFromOrigin, pose));
                }
                if (joint.TryGetRadius(out radius))
                {
                    entry.Radius = radius;
                }
                message.Joints.Add(entry);
            }
            return message;
        }
    }
}
#endif
