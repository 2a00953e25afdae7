class_name GraspTracker
## Hands between messages and [XRHandTracker]: the giver's hand for requests, and a found hand for everything that follows trackers, such as
## [XRHandModifier3D], [XRNode3D] and the hands of other add-ons.

const _VALID := XRHandTracker.HAND_JOINT_FLAG_POSITION_VALID | XRHandTracker.HAND_JOINT_FLAG_ORIENTATION_VALID
const _TRACKED := XRHandTracker.HAND_JOINT_FLAG_POSITION_TRACKED | XRHandTracker.HAND_JOINT_FLAG_ORIENTATION_TRACKED


## The tracked hand as [code]presentingHand[/code] of a holdout. Trackers are in the space of the [XROrigin3D], so pass its
## [code]global_transform[/code].
##
## A hand without tracking has no joints, a joint without tracking no pose: [method GraspClient.find_grasp] refuses them by name, a
## [GraspTrack] takes the hand where it was last.
static func presenting_hand(tracker: XRHandTracker, client_from_origin := Transform3D.IDENTITY) -> Dictionary:
	var joints: Array[Dictionary] = []
	if tracker.has_tracking_data:
		for joint in GraspHand.JOINT_COUNT:
			if tracker.get_hand_joint_flags(joint) & _VALID == _VALID:
				joints.append({
					"pose": GraspJson.pose(client_from_origin * tracker.get_hand_joint_transform(joint)),
					"radius": tracker.get_hand_joint_radius(joint),
				})
			else:
				joints.append({})
	var is_left := tracker.hand == XRPositionalTracker.TRACKER_HAND_LEFT
	return {"joints": {"handedness": "HANDEDNESS_LEFT" if is_left else "HANDEDNESS_RIGHT", "joints": joints}}


## Poses a tracker, which the caller has made and added to the [XRServer]. [param client_from_origin] is the origin's
## [code]global_transform[/code].
static func pose(tracker: XRHandTracker, hand: GraspHand, client_from_origin := Transform3D.IDENTITY) -> void:
	var origin_from_client := client_from_origin.affine_inverse()
	tracker.hand = XRPositionalTracker.TRACKER_HAND_LEFT if hand.handedness == GraspHand.LEFT else XRPositionalTracker.TRACKER_HAND_RIGHT
	for joint in GraspHand.JOINT_COUNT:
		var has_joint := hand.has_joint(joint)
		tracker.set_hand_joint_flags(joint, _VALID | _TRACKED if has_joint else 0)
		if has_joint:
			tracker.set_hand_joint_transform(joint, origin_from_client * hand.joints[joint])
			tracker.set_hand_joint_radius(joint, hand.radii[joint])
	var palm := tracker.get_hand_joint_transform(XRHandTracker.HAND_JOINT_PALM)
	tracker.set_pose("default", palm, Vector3.ZERO, Vector3.ZERO, XRPose.XR_TRACKING_CONFIDENCE_HIGH)
	tracker.has_tracking_data = true
