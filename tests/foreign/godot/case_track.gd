extends GraspCase
## A track of a giver who moves and loses tracking: one request at a time, the latest frame wins, and the hand stays on the object.

const FRAMES := 60

var answers: Array[GraspTrack.Answer] = []


func run() -> void:
	var request: Dictionary = read_json("proto/golden/grasps.json").vectors[3].conventions[3].request
	var object := GraspJson.read_pose(request.holdout.clientFromObject)
	var hand := GraspHand.from_json(request.holdout.presentingHand.pose)
	hand.object_from_wrist = object.affine_inverse() * hand.client_from_wrist
	(await client.get_rig(hand.rig)).pose(hand)
	var giver := XRHandTracker.new()
	var track := await client.create_track({"holdout": {"object": "objects/remote"}, "receiver": {"handedness": "HANDEDNESS_LEFT"}})
	expect(track.error == null and track.name.begins_with("tracks/"), "created: %s" % track.error)
	track.answered.connect(func(answer: GraspTrack.Answer) -> void: answers.append(answer))
	for step in FRAMES:
		var world_from_object := Transform3D(Basis(Vector3.UP, step * 0.02), Vector3(step * 0.004, 1.2, 0)) * object
		GraspTracker.pose(giver, hand.at_object(world_from_object))
		if step >= 30 and step < 36:
			giver.has_tracking_data = false
		elif step >= 40 and step < 46:
			giver.set_hand_joint_flags(XRHandTracker.HAND_JOINT_RING_FINGER_TIP, 0)
		track.push({"holdout": {
			"clientFromObject": GraspJson.pose(world_from_object),
			"presentingHand": GraspTracker.presenting_hand(giver),
		}})
		await create_timer(0.011).timeout
	await create_timer(0.1).timeout
	expect(track.error == null, "frames are answered: %s" % track.error)
	check_answers(track)
	await track.close()
	track.push({})
	await create_timer(0.05).timeout
	expect(track.name == "", "the track is closed")


func check_answers(track: GraspTrack) -> void:
	var statuses := {}
	var warned := 0
	for answer in answers:
		statuses[answer.status] = statuses.get(answer.status, 0) + 1
		warned += 1 if answer.warnings else 0
	print("%d answers to %d frames: %s, %d with warnings" % [answers.size(), FRAMES, statuses, warned])
	print(answers.filter(func(answer: GraspTrack.Answer) -> bool: return not answer.warnings.is_empty()).map(
		func(answer: GraspTrack.Answer) -> String: return answer.warnings[0]))
	expect(answers.size() > FRAMES / 4 and answers.size() <= FRAMES, "most frames are answered")
	for index in range(1, answers.size()):
		expect(answers[index].sequence == answers[index - 1].sequence + 1, "one at a time, in order")
	var found := answers.filter(func(answer: GraspTrack.Answer) -> bool: return answer.status != "NONE")
	expect(found[0].status == "REPLANNED" and statuses.get("KEPT", 0) > answers.size() / 2, "the grasp is found, then mostly kept")
	expect(warned > 0 and warned < answers.size() / 2, "the giver's lost hand is warned of")
	expect(track.grasp != null and track.grasp.hand.handedness == GraspHand.LEFT, "a left hand")
	var kept := answers.filter(func(answer: GraspTrack.Answer) -> bool: return answer.status == "KEPT")
	if kept:
		var last: Grasp = kept[-1].grasp
		expect(last.hand.joints.size() == GraspHand.JOINT_COUNT and last.contacts.size() >= 2, "a kept grasp is whole")
		var wrist := last.hand.joints[XRHandTracker.HAND_JOINT_WRIST].origin
		expect_within(1e-5, wrist.distance_to(last.hand.client_from_wrist.origin), "its joints are at its wrist, m")
