extends GraspCase
## Hands with bones of other names and axes, a hand of a rig that was created from its model, and trackers.

const FINGERS: Array[String] = ["Thumb", "Index", "Middle", "Ring", "Little"]
const PARTS: Array[String] = ["Metacarpal", "Proximal", "Intermediate", "Distal", "Tip"]


func run() -> void:
	var hands := {}
	for side: String in ["LEFT", "RIGHT"]:
		var answer := await client.find_grasp({
			"holdout": {"object": "objects/remote", "clientFromObject": GraspJson.pose(Transform3D(Basis(Vector3.ONE.normalized(), 1), Vector3.ONE))},
			"receiver": {"handedness": "HANDEDNESS_" + side},
		})
		hands[side] = answer.grasp.hand
		# Godot XR Tools: +Y to the tip, and palms at +X of left hands, at -X of right ones.
		var palm := Vector3.RIGHT if side == "LEFT" else Vector3.LEFT
		check_names(hands[side], "%s_" + side.left(1), Basis(palm.cross(Vector3.UP), palm, Vector3.UP), "XR Tools, " + side)
		# Blender: +Y to the tip, +Z to the back of the hand.
		check_names(hands[side], "%s." + side.left(1), Basis(Vector3.LEFT, Vector3.BACK, Vector3.UP).inverse(), "Blender, " + side)
		check_tracker(hands[side])
		await check_model(side)
	check_character(hands)


## A skeleton with the bones of a stretched hand: [param pattern] around OpenXR's names, axes turned.
func check_names(hand: GraspHand, pattern: String, openxr_from_bone: Basis, of: String) -> void:
	var skeleton := Skeleton3D.new()
	root.add_child(skeleton)
	add_hand(skeleton, hand.handedness, func(name: String) -> String: return pattern % name.replace(" ", "_"), openxr_from_bone)
	expect(GraspSkeleton.new(skeleton).pose(hand), of + ": has bones")
	compare(skeleton, hand, func(name: String) -> String: return pattern % name.replace(" ", "_"), openxr_from_bone, of)
	skeleton.free()


## Both hands of a character with the names of Godot's humanoid profile.
func check_character(hands: Dictionary) -> void:
	var skeleton := Skeleton3D.new()
	root.add_child(skeleton)
	skeleton.add_bone("Hips")
	for side: String in hands:
		add_hand(skeleton, hands[side].handedness, humanoid(side), GraspConvention.JOINT_TURN)
	var bones := GraspSkeleton.new(skeleton)
	for side: String in hands:
		expect(bones.pose(hands[side]), "humanoid: has bones")
	for side: String in hands:
		compare(skeleton, hands[side], humanoid(side), GraspConvention.JOINT_TURN, "humanoid, " + side)
	var empty := Skeleton3D.new()
	root.add_child(empty)
	expect(not GraspSkeleton.new(empty).pose(hands.LEFT), "no bones, no pose")


func humanoid(side: String) -> Callable:
	return func(name: String) -> String: return side.capitalize() + ("Hand" if name == "Wrist" else name.replace(" ", ""))


func add_hand(skeleton: Skeleton3D, handedness: int, named: Callable, openxr_from_bone: Basis) -> void:
	var model := load_hand("adult_left" if handedness == GraspHand.LEFT else "adult_right")
	var names := joint_names()
	for bone in model.get_bone_count():
		var parent := model.get_bone_parent(bone)
		var index := skeleton.add_bone(named.call(names[bone + 1]))
		var turn := Transform3D(openxr_from_bone)
		var rest := model.get_bone_rest(bone) * turn
		if parent >= 0:
			skeleton.set_bone_parent(index, skeleton.find_bone(named.call(names[parent + 1])))
			rest = turn.inverse() * rest
		skeleton.set_bone_rest(index, rest)
	skeleton.reset_bone_poses()


## The names of the joints after the palm, which are the bones of our models in order.
func joint_names() -> Array[String]:
	var names: Array[String] = ["Palm", "Wrist"]
	for finger in FINGERS:
		for part in PARTS:
			if finger != "Thumb" or part != "Intermediate":
				names.append(finger + " " + part)
	return names


func compare(skeleton: Skeleton3D, hand: GraspHand, named: Callable, openxr_from_bone: Basis, of: String) -> void:
	var farthest := 0.0
	var turned := 0.0
	var names := joint_names()
	for joint in range(1, GraspHand.JOINT_COUNT):
		var posed := skeleton.get_bone_global_pose(skeleton.find_bone(named.call(names[joint])))
		farthest = maxf(farthest, posed.origin.distance_to(hand.joints[joint].origin))
		turned = maxf(turned, angle(posed.basis * openxr_from_bone.inverse() * GraspConvention.JOINT_TURN, hand.joints[joint].basis))
	expect_within(1e-5, farthest, of + ": bones to joints, m")
	expect_within(2e-3, turned, of + ": bones to joints, rad")


## A rig that was created from the very model: its bones are posed as the server says, at half again the size.
func check_model(side: String) -> void:
	var model := FileAccess.get_file_as_bytes(repository.path_join("assets/hands/adult_%s.glb" % side.to_lower()))
	var rig_id := "godot-" + side.to_lower()
	var created := await client.ask("grasp.v1.HandRigService/CreateRig", {
		"rigId": rig_id, "models": [Marshalls.raw_to_base64(model)], "handedness": "HANDEDNESS_" + side,
	})
	expect(created.error == null, "created: %s" % created.error)
	for scale: float in [1.0, 1.5]:
		var answer := await client.find_grasp({
			"holdout": {"object": "objects/remote"},
			"receiver": {"rig": "rigs/" + rig_id, "handedness": "HANDEDNESS_" + side, "scale": scale},
			"search": {"budget": "10s"},
		})
		expect(answer.grasp != null and not answer.grasp.hand.model.is_empty(), "a grasp of the created rig: %s" % answer.error)
		if not answer.grasp:
			continue
		var hand := answer.grasp.hand.at_object(Transform3D(Basis(Vector3.UP, 1), Vector3.ONE))
		var skeleton := load_hand("adult_" + side.to_lower())
		GraspSkeleton.new(skeleton).pose(hand)
		var farthest := 0.0
		for bone in skeleton.get_bone_count():
			# Tips of created rigs are where the skin ends, which the nodes of tips are not.
			if bone + 1 not in GraspHand.TIPS:
				farthest = maxf(farthest, skeleton.get_bone_global_pose(bone).origin.distance_to(hand.joints[bone + 1].origin))
		expect_within(1e-5, farthest, "%s, scale %s: bones of the model to joints, m" % [rig_id, scale])
	await client.ask("grasp.v1.HandRigService/DeleteRig", {"name": "rigs/" + rig_id})


func check_tracker(hand: GraspHand) -> void:
	var origin := Transform3D(Basis(Vector3.UP, 0.7), Vector3(2, 0, 1))
	var tracker := XRHandTracker.new()
	GraspTracker.pose(tracker, hand, origin)
	var sent := GraspTracker.presenting_hand(tracker, origin)
	expect(sent.joints.handedness == hand.to_json().handedness, "the tracker's hand")
	var farthest := 0.0
	for joint in GraspHand.JOINT_COUNT:
		var pose := GraspJson.read_pose(sent.joints.joints[joint].pose)
		farthest = maxf(farthest, pose.origin.distance_to(hand.joints[joint].origin))
		farthest = maxf(farthest, angle(pose.basis, hand.joints[joint].basis) * 1e-3)
		farthest = maxf(farthest, absf(sent.joints.joints[joint].radius - hand.radii[joint]))
	expect_within(1e-5, farthest, "to a tracker and back, m")
	tracker.set_hand_joint_flags(XRHandTracker.HAND_JOINT_RING_FINGER_TIP, 0)
	expect(GraspTracker.presenting_hand(tracker).joints.joints[XRHandTracker.HAND_JOINT_RING_FINGER_TIP] == {}, "a lost joint")
	tracker.has_tracking_data = false
	expect(GraspTracker.presenting_hand(tracker).joints.joints == [], "a lost hand")
