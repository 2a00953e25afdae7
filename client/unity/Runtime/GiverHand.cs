using Grasp.V1;
using UnityEngine;

namespace GraspClient
{
    /// <summary>The hand of the person who holds the object out.</summary>
    public abstract class GiverHand : MonoBehaviour
    {
        /// <summary>The hand now, in Unity's world; null without one.</summary>
        public abstract PresentingHand Read();
    }
}
