class_name GraspHand
extends RefCounted
## A posed hand: the contract's [code]HandPose[/code], in meters and with the joint axes of [XRHandTracker], whose +Y points to the
## fingertips and +Z to the palm's side.

## Numbers of the contract's enum [code]Handedness[/code].
enum { LEFT = 1, RIGHT = 2 }

## The number of joints, in the order of [enum XRHandTracker.HandJoint].
const JOINT_COUNT := XRHandTracker.HAND_JOINT_MAX

## The names of the digits in messages, thumb first.
const DIGITS: Array[String] = ["thumb", "index", "middle", "ring", "little"]

## The joint that each joint hangs on; the wrist hangs on none.
const PARENTS: Array[int] = [1, -1, 1, 2, 3, 4, 1, 6, 7, 8, 9, 1, 11, 12, 13, 14, 1, 16, 17, 18, 19, 1, 21, 22, 23, 24]

## The first and the last joint of each digit.
const FIRST_JOINTS: Array[int] = [2, 6, 11, 16, 21]
const TIPS: Array[int] = [5, 10, 15, 20, 25]

## Names of angles in messages.
const ANGLES: Array[String] = ["baseYaw", "basePitch", "secondPitch", "thirdPitch"]

## The rig's name, such as "rigs/adult".
var rig := ""
## [constant LEFT] or [constant RIGHT].
var handedness := RIGHT
## The hand's size over the rig's.
var scale := 1.0
## The wrist in the client's frame: that of the request's poses, mostly the world.
var client_from_wrist := Transform3D.IDENTITY
## The wrist in the object's frame.
var object_from_wrist := Transform3D.IDENTITY
## Per digit that the hand has, by its index in [constant DIGITS], four angles in radians: base yaw, then pitches of the base, second and third
## joint.
var digits: Dictionary[int, PackedFloat32Array] = {}
## The joints in the client's frame; empty if only angles are known, as of an unpacked grasp: see [GraspRig].
var joints: Array[Transform3D] = []
## Distance of each joint to the skin.
var radii := PackedFloat32Array()
## The poses of the nodes of a created rig's model, the root first: arrays of a name, a pose, and whether it has a position.
var model: Array[Array] = []


## Reads a hand of an answer, in any convention. One without a convention of its own has [param convention].
static func from_json(message: Dictionary, convention := "CONVENTION_GODOT") -> GraspHand:
	var hand := GraspHand.new()
	var from := GraspConvention.named(message.get("convention", convention))
	hand.rig = message.get("rig", "")
	hand.handedness = LEFT if message.get("handedness") == "HANDEDNESS_LEFT" else RIGHT
	hand.scale = message.get("scale", 1.0)
	hand.client_from_wrist = from.joint(GraspJson.read_pose(message.get("clientFromWrist", {})))
	hand.object_from_wrist = from.joint_at_object(GraspJson.read_pose(message.get("objectFromWrist", {})))
	for digit in DIGITS.size():
		if message.has(DIGITS[digit]):
			hand.digits[digit] = _read_angles(message[DIGITS[digit]])
	var sent: Array = message.get("joints", [])
	if sent.size() == JOINT_COUNT:
		hand.joints.resize(JOINT_COUNT)
		hand.radii.resize(JOINT_COUNT)
		for place in JOINT_COUNT:
			var index := from.joint_index(place)
			hand.joints[index] = from.joint(GraspJson.read_pose(sent[place].get("pose", {})))
			hand.radii[index] = sent[place].get("radius", 0.0) * from.meters
	for node: Dictionary in message.get("model", []):
		var pose: Dictionary = node.get("pose", {})
		hand.model.append([node.node, GraspJson.read_pose(pose), pose.has("position")])
	return hand


## The hand as requests take it: as [code]holdout.presentingHand.pose[/code], [code]current.grasp[/code] or a known grip.
func to_json() -> Dictionary:
	var message := {
		"rig": rig,
		"handedness": "HANDEDNESS_LEFT" if handedness == LEFT else "HANDEDNESS_RIGHT",
		"scale": scale,
		"clientFromWrist": GraspJson.pose(client_from_wrist),
		"objectFromWrist": GraspJson.pose(object_from_wrist),
		"convention": "CONVENTION_GODOT",
	}
	for digit: int in digits:
		var angles := {}
		for index in ANGLES.size():
			angles[ANGLES[index]] = digits[digit][index]
		message[DIGITS[digit]] = angles
	return message


## Whether the hand has a joint: fingers may be missing.
func has_joint(joint: int) -> bool:
	for digit in DIGITS.size():
		if joint >= FIRST_JOINTS[digit] and joint <= TIPS[digit]:
			return digits.has(digit)
	return true


## The same hand with its wrist elsewhere.
func at_wrist(wrist: Transform3D) -> GraspHand:
	var moved := _copy()
	var motion := wrist * client_from_wrist.affine_inverse()
	moved.client_from_wrist = wrist
	for joint in moved.joints.size():
		moved.joints[joint] = motion * joints[joint]
	if not model.is_empty():
		moved.model[0] = [model[0][0], motion * (model[0][1] as Transform3D), true]
	return moved


## The same hand at the object where it is now: [code]hand.at_object(node.global_transform)[/code]. A hand that is posed so in each frame
## stays on an object that moves.
func at_object(client_from_object: Transform3D) -> GraspHand:
	return at_wrist(client_from_object.orthonormalized() * object_from_wrist)


## A hand on the way from this one to another, [param weight] from 0 to 1. The wrist moves straight in the object's frame, fingers turn
## in their joints. Both hands need joints; if one is left and one right, there is no way, and the answer is [param to].
func toward(to: GraspHand, weight: float) -> GraspHand:
	if handedness != to.handedness or joints.is_empty() or to.joints.is_empty():
		return to
	var hand := to._copy()
	hand.object_from_wrist = object_from_wrist.interpolate_with(to.object_from_wrist, weight)
	hand.client_from_wrist = to.client_from_wrist * to.object_from_wrist.affine_inverse() * hand.object_from_wrist
	hand.joints[XRHandTracker.HAND_JOINT_WRIST] = hand.client_from_wrist
	for joint in JOINT_COUNT:
		if joint != XRHandTracker.HAND_JOINT_WRIST:
			hand.joints[joint] = hand.joints[PARENTS[joint]] * _local(joint).interpolate_with(to._local(joint), weight)
	if not model.is_empty() and model.size() == to.model.size():
		_blend_model(hand, to, weight)
	return hand


func _blend_model(hand: GraspHand, to: GraspHand, weight: float) -> void:
	var root: Transform3D = to.model[0][1]
	hand.model[0] = [to.model[0][0], hand.client_from_wrist * to.client_from_wrist.affine_inverse() * root, true]
	for node in range(1, model.size()):
		var pose := (model[node][1] as Transform3D).interpolate_with(to.model[node][1], weight)
		hand.model[node] = [to.model[node][0], pose, to.model[node][2]]


func _local(joint: int) -> Transform3D:
	return joints[PARENTS[joint]].affine_inverse() * joints[joint]


func _copy() -> GraspHand:
	var copy := GraspHand.new()
	copy.rig = rig
	copy.handedness = handedness
	copy.scale = scale
	copy.client_from_wrist = client_from_wrist
	copy.object_from_wrist = object_from_wrist
	copy.digits = digits
	copy.joints = joints.duplicate()
	copy.radii = radii
	copy.model = model.duplicate()
	return copy


static func _read_angles(message: Dictionary) -> PackedFloat32Array:
	var second: float = message.get("secondPitch", 0.0)
	return [message.get("baseYaw", 0.0), message.get("basePitch", 0.0), second, message.get("thirdPitch", second * 2.0 / 3.0)]
