class_name GraspRig
extends RefCounted
## The bones of a rig's hands: poses the joints of a hand of which only the angles are known, as of an unpacked grasp.
##
## Comes from [method GraspClient.get_rig], once for each rig that a game uses.

## The joint of each digit that yaws: the thumb's metacarpal, a finger's proximal.
const _BASES: Array[int] = [2, 7, 12, 17, 22]

var _hands: Dictionary[int, Hand] = {}


class Hand:
	## OpenXR's joints of the stretched hand, in the wrist's frame.
	var joints: Array[Transform3D] = []
	var radii := PackedFloat32Array()
	## The angles of the stretched hand by digit: 0, or the limit next to it.
	var angles: Dictionary[int, PackedFloat32Array] = {}


## Reads the contract's [code]HandRig[/code].
static func from_json(message: Dictionary) -> GraspRig:
	var rig := GraspRig.new()
	for sent: Dictionary in message.hands:
		var hand := Hand.new()
		for joint: Dictionary in sent.stretchedJoints:
			hand.joints.append(GraspJson.read_pose(joint.get("pose", {})))
			hand.radii.append(joint.get("radius", 0.0))
		for limits: Dictionary in sent.limits:
			var digit := GraspHand.DIGITS.find(limits.digit.trim_prefix("DIGIT_").to_lower())
			var angles := PackedFloat32Array()
			for angle in GraspHand.ANGLES:
				angles.append(clampf(0.0, limits.min.get(angle, 0.0), limits.max.get(angle, 0.0)))
			hand.angles[digit] = angles
		rig._hands[GraspHand.LEFT if sent.handedness == "HANDEDNESS_LEFT" else GraspHand.RIGHT] = hand
	return rig


## Sets the joints and radii of [param hand], a hand of this rig, from its wrist, angles and scale.
func pose(hand: GraspHand) -> void:
	var bones := _hands[hand.handedness]
	var turned: Array[Transform3D] = bones.joints.duplicate()
	for digit: int in hand.digits:
		var stretched := bones.angles[digit]
		var angles := hand.digits[digit]
		for index in 4:
			var joint := _BASES[digit] + index
			var parent := Transform3D.IDENTITY if index == 0 else bones.joints[joint - 1]
			var local := parent.affine_inverse() * bones.joints[joint]
			if index == 0:
				local.basis *= _base_turn(hand.handedness, digit, stretched).transposed() * _base_turn(hand.handedness, digit, angles)
			elif index < 3:
				local.basis *= Basis(Vector3.RIGHT, stretched[index + 1] - angles[index + 1])
			turned[joint] = (Transform3D.IDENTITY if index == 0 else turned[joint - 1]) * local
	hand.joints.resize(GraspHand.JOINT_COUNT)
	hand.radii = bones.radii.duplicate()
	for joint in GraspHand.JOINT_COUNT:
		var local := turned[joint]
		local = Transform3D(local.basis, local.origin * hand.scale)
		hand.joints[joint] = hand.client_from_wrist * _turned(_turned(Transform3D.IDENTITY) * local)
		hand.radii[joint] *= hand.scale


## A pose with the half turn between the axes of OpenXR's joints and Godot's.
static func _turned(pose: Transform3D) -> Transform3D:
	return Transform3D(pose.basis * GraspConvention.JOINT_TURN, pose.origin)


## Yaw about +Y, to opposite sides for the thumb and the fingers and for both hands, then pitch about +X.
static func _base_turn(handedness: int, digit: int, angles: PackedFloat32Array) -> Basis:
	var side := 1.0 if (digit == 0) == (handedness == GraspHand.RIGHT) else -1.0
	return Basis(Vector3.UP, side * angles[0]) * Basis(Vector3.RIGHT, -angles[1])
