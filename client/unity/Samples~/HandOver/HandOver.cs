using GraspClient;
using UnityEngine;

/// <summary>A character takes an object that comes within its reach: to be put on the character, beside a disabled
/// GraspReceiver.</summary>
[RequireComponent(typeof(GraspReceiver))]
public sealed class HandOver : MonoBehaviour
{
    [Tooltip("How near the object has to come to the character, in meters.")]
    public float reach = 1.2f;

    GraspReceiver receiver;

    void Awake()
    {
        receiver = GetComponent<GraspReceiver>();
        receiver.Grasped += grasp => Debug.Log(grasp == null ? "no grasp" : grasp.Type + ", score " + grasp.Score);
    }

    void Update()
    {
        Vector3 way = receiver.heldObject.position - transform.position;
        // Not its height: a character's origin is between its feet.
        way.y = 0;
        receiver.enabled = way.magnitude < reach;
    }
}
