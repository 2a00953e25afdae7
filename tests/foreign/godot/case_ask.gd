extends GraspCase
## Our hands, posed by answers: bones at the answered joints, and the skin at the contacts. Left hands are left.


func run() -> void:
	var world_from_object := Transform3D(Basis(Vector3(1, 2, -1).normalized(), 0.8), Vector3(0.4, 1.2, -0.7))
	for side: String in ["left", "right"]:
		var skeleton := load_hand("adult_" + side)
		skeleton.get_parent().transform = Transform3D(Basis(Vector3.UP, 1.0), Vector3(3, 0, 1))
		var bones := GraspSkeleton.new(skeleton)
		for object: String in ["scissors", "remote", "scalpel"]:
			var answer := await client.find_grasp({
				"holdout": {"object": "objects/" + object, "clientFromObject": GraspJson.pose(world_from_object)},
				"receiver": {"handedness": "HANDEDNESS_" + side.to_upper()},
				"search": {"seed": 1, "choice": "GRASP_CHOICE_REPRODUCIBLE", "budget": "5s"},
			})
			expect(answer.error == null and answer.outcome == "FOUND", "%s, %s: %s" % [object, side, answer.error])
			if not answer.grasp:
				continue
			var hand := answer.grasp.hand
			expect(hand.handedness == (GraspHand.LEFT if side == "left" else GraspHand.RIGHT), "it is a %s hand" % side)
			expect(bones.pose(hand), "the skeleton has its bones")
			var wrist := world_from_object * hand.object_from_wrist
			expect_within(1e-5, wrist.origin.distance_to(hand.client_from_wrist.origin), "%s, %s: both wrists, m" % [object, side])
			check_joints(skeleton, hand, "%s, %s" % [object, side])
			check_skin(skeleton, world_from_object, answer.grasp, "%s, %s" % [object, side])
			var moved := Transform3D(Basis(Vector3.RIGHT, 2.0), Vector3(-1, 0, 2))
			bones.pose(hand.at_object(moved))
			check_joints(skeleton, hand.at_object(moved), "%s, %s, moved" % [object, side])
			check_skin(skeleton, moved, answer.grasp, "%s, %s, moved" % [object, side])
	await check_stream()


## The best grasps that differ, one message each.
func check_stream() -> void:
	var found: Array[Grasp] = []
	var last := await client.stream_grasps({
		"holdout": {"object": "objects/scissors"},
		"receiver": {"handedness": "HANDEDNESS_LEFT"},
		"search": {"budget": "0.5s"},
		"alternatives": {"count": 3},
	}, func(answer: GraspAnswer) -> void: found.append(answer.grasp))
	print("streamed: %s, %s" % [found.map(func(grasp: Grasp) -> String: return grasp.type), last.outcome])
	expect(found.size() == 3 and last.outcome == "FOUND" and last.error == null, "three grasps: %s" % last.error)
	var wrong := await client.stream_grasps({"holdout": {"object": "objects/nowhere"}}, func(_answer: GraspAnswer) -> void: pass)
	expect(wrong.error != null and wrong.error.code == "not_found", "an error at the end of a stream")


func check_joints(skeleton: Skeleton3D, hand: GraspHand, of: String) -> void:
	var farthest := 0.0
	var turned := 0.0
	for joint in GraspHand.JOINT_COUNT:
		var bone := skeleton.find_bone(BONES[joint])
		if bone >= 0:
			var posed := skeleton.global_transform * skeleton.get_bone_global_pose(bone)
			farthest = maxf(farthest, posed.origin.distance_to(hand.joints[joint].origin))
			turned = maxf(turned, angle(posed.basis * GraspConvention.JOINT_TURN, hand.joints[joint].basis))
	expect_within(1e-3, farthest, of + ": bones to joints, m")
	expect_within(2e-3, turned, of + ": bones to joints, rad")


func check_skin(skeleton: Skeleton3D, world_from_object: Transform3D, grasp: Grasp, of: String) -> void:
	var skin := GraspMeshes.posed_triangles(skeleton)
	var deepest := 0.0
	for contact in grasp.contacts:
		var point := skeleton.global_transform.affine_inverse() * world_from_object * contact.position
		deepest = maxf(deepest, GraspMeshes.distance(point, skin))
	# Flesh yields by two millimeters.
	expect_within(2e-3, deepest, of + ": contacts to skin, m")


const BONES: Array[String] = [
	"palm", "wrist", "thumb-metacarpal", "thumb-phalanx-proximal", "thumb-phalanx-distal", "thumb-tip",
	"index-finger-metacarpal", "index-finger-phalanx-proximal", "index-finger-phalanx-intermediate",
	"index-finger-phalanx-distal", "index-finger-tip",
	"middle-finger-metacarpal", "middle-finger-phalanx-proximal", "middle-finger-phalanx-intermediate",
	"middle-finger-phalanx-distal", "middle-finger-tip",
	"ring-finger-metacarpal", "ring-finger-phalanx-proximal", "ring-finger-phalanx-intermediate",
	"ring-finger-phalanx-distal", "ring-finger-tip",
	"pinky-finger-metacarpal", "pinky-finger-phalanx-proximal", "pinky-finger-phalanx-intermediate",
	"pinky-finger-phalanx-distal", "pinky-finger-tip",
]
