class_name GraspSkeleton
extends RefCounted
## Poses the bones of a hand in a [Skeleton3D], which may be a whole character's.
##
## Bones are found by their names in WebXR, OpenXR or Godot's humanoid profile: "index-finger-phalanx-proximal", "Index_Proximal_L" (as
## in Godot XR Tools), "LeftIndexProximal". Their axes are seen in the rest pose. A hand of a rig that was created from the very model is posed
## exactly as the server says ([member GraspHand.model]); all others get their joints' positions, so bones are as long as the rig's.

const _JOINT_NAMES: Array[String] = [
	"palm", "wrist", "thumb metacarpal", "thumb proximal", "thumb distal", "thumb tip",
	"index metacarpal", "index proximal", "index intermediate", "index distal", "index tip",
	"middle metacarpal", "middle proximal", "middle intermediate", "middle distal", "middle tip",
	"ring metacarpal", "ring proximal", "ring intermediate", "ring distal", "ring tip",
	"little metacarpal", "little proximal", "little intermediate", "little distal", "little tip",
]
## Words of a bone's name that mean nothing, or another one.
const _WORDS := {"finger": "", "phalanx": "", "left": "", "right": "", "l": "", "r": "", "pinky": "little", "hand": "wrist"}

## The skeleton that is posed.
var skeleton: Skeleton3D

var _handedness := 0
var _bones: Dictionary[int, int] = {}
## The axes of bones in those of Godot's joints.
var _joint_from_bone := Basis.IDENTITY


func _init(posed_skeleton: Skeleton3D) -> void:
	skeleton = posed_skeleton


## Poses the hand. The client's frame is the world: to move a hand elsewhere, see [method GraspHand.at_object]. False if the skeleton has no
## bones for such a hand.
func pose(hand: GraspHand) -> bool:
	var skeleton_from_client := skeleton.global_transform.affine_inverse()
	if not hand.model.is_empty() and skeleton.find_bone(hand.model[0][0]) >= 0:
		_pose_model(hand, skeleton_from_client)
		return true
	if hand.handedness != _handedness:
		_find_bones(hand.handedness)
	if _bones.is_empty() or hand.joints.is_empty():
		return false
	for joint: int in _bones:
		if hand.has_joint(joint):
			var bone := skeleton_from_client * hand.joints[joint]
			bone.basis = bone.basis * _joint_from_bone * hand.scale
			skeleton.set_bone_global_pose(_bones[joint], bone)
	return true


func _pose_model(hand: GraspHand, skeleton_from_client: Transform3D) -> void:
	var root := skeleton_from_client * (hand.model[0][1] as Transform3D)
	root.basis *= hand.scale
	skeleton.set_bone_global_pose(skeleton.find_bone(hand.model[0][0]), root)
	for node: Array in hand.model.slice(1):
		var bone := skeleton.find_bone(node[0])
		if bone >= 0:
			skeleton.set_bone_pose_rotation(bone, (node[1] as Transform3D).basis.get_rotation_quaternion())
			if node[2]:
				skeleton.set_bone_pose_position(bone, node[1].origin)


## Finds the bones of one hand, wrist first. The palm follows the wrist.
func _find_bones(handedness: int) -> void:
	_handedness = handedness
	_bones.clear()
	var found := {}
	for bone in skeleton.get_bone_count():
		var words := skeleton.get_bone_name(bone).to_snake_case().replace("-", "_").replace(".", "_").split("_", false)
		var is_left := "left" in words or "l" in words
		var is_right := "right" in words or "r" in words
		if is_left != is_right and is_left != (handedness == GraspHand.LEFT):
			continue
		var kept := Array(words).map(func(word: String) -> String: return _WORDS.get(word, word))
		found[" ".join(kept.filter(func(word: String) -> bool: return word != ""))] = bone
	for joint in range(XRHandTracker.HAND_JOINT_WRIST, GraspHand.JOINT_COUNT):
		if found.has(_JOINT_NAMES[joint]):
			_bones[joint] = found[_JOINT_NAMES[joint]]
	var middle := XRHandTracker.HAND_JOINT_MIDDLE_FINGER_PHALANX_PROXIMAL
	var needed := [XRHandTracker.HAND_JOINT_WRIST, middle, middle + 1, middle - 5, middle + 10]
	if needed.any(func(joint: int) -> bool: return not _bones.has(joint)):
		_bones.clear()
		return
	_joint_from_bone = _axes_of_bones(middle)


## Which axes of the bones point to the fingertips and to the palm's side, by the middle finger, whose axes all others share.
func _axes_of_bones(middle: int) -> Basis:
	var rest := func(joint: int) -> Transform3D: return skeleton.get_bone_global_rest(_bones[joint])
	var finger: Vector3 = rest.call(middle + 1).origin - rest.call(middle).origin
	var to_thumb: Vector3 = rest.call(middle - 5).origin - rest.call(middle + 10).origin
	var to_palm := to_thumb.cross(finger) if _handedness == GraspHand.RIGHT else finger.cross(to_thumb)
	var bone_from_skeleton: Basis = rest.call(middle).basis.inverse()
	var y := _nearest_axis(bone_from_skeleton * finger)
	var along_palm := bone_from_skeleton * to_palm
	var z := _nearest_axis(along_palm - y * along_palm.dot(y))
	return Basis(y.cross(z), y, z).transposed()


static func _nearest_axis(v: Vector3) -> Vector3:
	var axis := Vector3.ZERO
	axis[v.abs().max_axis_index()] = signf(v[v.abs().max_axis_index()])
	return axis
