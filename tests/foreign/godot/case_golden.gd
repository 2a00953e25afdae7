extends GraspCase
## The golden grasps: in each convention converted to Godot's, unpacked, and with joints from the angles alone.

const METERS := 1e-5
const PACKED_METERS := 5e-4
const PACKED_RADIANS := deg_to_rad(0.5)

var farthest := {}


func run() -> void:
	var golden := read_json("proto/golden/grasps.json")
	var rigs := {}
	for rig: String in golden.rigs:
		rigs[rig] = GraspRig.from_json(golden.rigs[rig])
	for vector: Dictionary in golden.vectors:
		var answers := {}
		for one: Dictionary in vector.conventions:
			answers[one.convention] = one.answer.grasps[0]
		for convention: String in answers:
			check_conversion(answers[convention], answers.CONVENTION_OPENXR)
			check_packed(answers[convention], rigs)
	for name: String in farthest:
		expect_within(farthest[name][1], farthest[name][0], name)
	expect(golden.vectors.size() == 12, "there are twelve vectors")
	await check_live(golden.vectors[3].conventions[3])


## Compares with OpenXR's answer, which is read here without the add-on's conversion, except for the half turn of joints.
func check_conversion(sent: Dictionary, openxr: Dictionary) -> void:
	var grasp := Grasp.from_json(sent)
	var hand := grasp.hand
	compare_joint("wrists in the client's frame", hand.client_from_wrist, openxr.hand.clientFromWrist)
	compare_joint("wrists in the object's frame", hand.object_from_wrist, openxr.hand.objectFromWrist)
	for joint in GraspHand.JOINT_COUNT:
		compare_joint("joints", hand.joints[joint], openxr.hand.joints[joint].pose)
		note("radii, m", absf(hand.radii[joint] - openxr.hand.joints[joint].radius), METERS)
	expect(grasp.contacts.size() == openxr.contacts.size(), "all contacts are there")
	for index in grasp.contacts.size():
		var contact := grasp.contacts[index]
		var expected: Dictionary = openxr.contacts[index]
		note("contacts, m", contact.position.distance_to(GraspJson.read_vector(expected.position)), METERS)
		note("normals", contact.normal.distance_to(GraspJson.read_vector(expected.normal)), METERS)
		# Single precision of forces of some ten newtons.
		note("forces, N", contact.force.distance_to(GraspJson.read_vector(expected.force)), METERS)


func compare_joint(name: String, joint: Transform3D, openxr: Dictionary) -> void:
	note(name + ", m", joint.origin.distance_to(GraspJson.read_vector(openxr.get("position", {}))), METERS)
	var turned := (joint.basis * GraspConvention.JOINT_TURN).get_rotation_quaternion()
	var expected := GraspJson.read_pose(openxr).basis.get_rotation_quaternion()
	var off := minf((turned - expected).length(), (turned + expected).length())
	note(name + ", quaternions", off, METERS)


func check_packed(sent: Dictionary, rigs: Dictionary) -> void:
	var answer := Grasp.from_json(sent)
	var exact := answer.hand
	var grasp := Grasp.unpack(answer.packed)
	var hand := grasp.hand
	expect(hand.rig == exact.rig and hand.handedness == exact.handedness and hand.scale == exact.scale, "unpacked: the hand")
	expect(grasp.type == answer.type, "unpacked: the type %s is %s" % [grasp.type, answer.type])
	expect(Array(grasp.touching) == Array(answer.touching), "unpacked: %s touch, not %s" % [grasp.touching, answer.touching])
	expect(hand.digits.keys() == exact.digits.keys(), "unpacked: the digits")
	note("packed wrists, m", hand.object_from_wrist.origin.distance_to(exact.object_from_wrist.origin), PACKED_METERS)
	note("packed wrists, rad", angle(hand.object_from_wrist.basis, exact.object_from_wrist.basis), PACKED_RADIANS)
	for digit: int in exact.digits:
		for index in 4:
			note("packed angles, rad", absf(hand.digits[digit][index] - exact.digits[digit][index]), PACKED_RADIANS)
	(rigs[hand.rig] as GraspRig).pose(hand)
	var there := exact.at_wrist(exact.object_from_wrist)
	for joint in GraspHand.JOINT_COUNT:
		note("packed joints, m", hand.joints[joint].origin.distance_to(there.joints[joint].origin), PACKED_METERS)
		note("packed joints, rad", angle(hand.joints[joint].basis, there.joints[joint].basis), 2 * PACKED_RADIANS)


## The same request asked now.
func check_live(vector: Dictionary) -> void:
	var answer := await client.find_grasp(vector.request)
	expect(answer.error == null, "live: %s" % answer.error)
	if answer.grasp:
		var expected := GraspHand.from_json(vector.answer.grasps[0].hand)
		for joint in GraspHand.JOINT_COUNT:
			note("live joints", answer.grasp.hand.joints[joint].origin.distance_to(expected.joints[joint].origin), METERS)
		expect_within(METERS, farthest["live joints"][0], "live joints, m")
	expect(Grasp.unpack(PackedByteArray()) == null and Grasp.unpack("12345678901234567890123".to_ascii_buffer()) == null, "no grasp")


func note(name: String, value: float, bound: float) -> void:
	farthest[name] = [maxf(value, farthest.get(name, [0.0])[0]), bound]
