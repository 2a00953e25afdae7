extends GraspCase
## The code of the README, in a project made by its commands: the hand is at the scissors, and everything else runs.
##
## Arguments: the script with all of the README's code.

func run() -> void:
	var scene: Node3D = (load("res://readme.gd") as GDScript).new()
	var origin := XROrigin3D.new()
	origin.name = "XROrigin3D"
	scene.add_child(origin)
	root.add_child(scene)
	await create_timer(0.5).timeout
	while scene.get_child_count() < 4:
		await process_frame
	await create_timer(0.5).timeout
	var skeleton: Skeleton3D = scene.find_children("*", "Skeleton3D", true, false)[0]
	var object: Node3D = scene.get_child(3)
	var faces := GraspMeshes.triangles(object)
	for finger: String in ["thumb", "middle-finger"]:
		var tip := skeleton.get_bone_global_pose(skeleton.find_bone(finger + "-tip"))
		expect_within(0.03, GraspMeshes.distance(tip.origin, faces), finger + " to the scissors, m")

	await scene.complain(client)
	await scene.create_rig(client, repository.path_join("assets/hands/adult_right.glb"))
	expect((await client.ask("grasp.v1.HandRigService/DeleteRig", {"name": "rigs/my-hand"})).error == null, "a rig was created")

	var giver := XRHandTracker.new()
	giver.name = "/user/hand_tracker/right"
	XRServer.add_tracker(giver)
	var packed := (await client.find_grasp({
		"holdout": {"object": "objects/scissors"}, "receiver": {"handedness": "HANDEDNESS_RIGHT"}, "output": {"packed": true},
	})).grasp
	GraspTracker.pose(giver, packed.hand)
	await scene.show_packed(client, packed.packed, object, skeleton)
	var thumb := skeleton.get_bone_global_pose(skeleton.find_bone("thumb-tip")).origin
	expect_within(5e-4, thumb.distance_to(packed.hand.joints[XRHandTracker.HAND_JOINT_THUMB_TIP].origin), "the packed thumb, m")

	var player := GraspPlayer.new()
	player.skeleton = load_hand("adult_left")
	scene.add_child(player)
	await scene.take(client, object, player)
	var track: GraspTrack = scene.track
	expect(track != null and track.name != "", "a track: %s" % (track.error if track else null))
	if not track or not track.name:
		return
	var answers: Array[GraspTrack.Answer] = []
	track.answered.connect(answers.append)
	track.push({"holdout": scene.holdout_now(object)})
	while answers.is_empty() and track.error == null:
		await process_frame
	expect(track.error == null, "the frame is answered: %s" % track.error)
	if answers:
		print(answers[0].status, " ", answers[0].warnings)
		expect(answers[0].status in ["KEPT", "ADJUSTED", "REPLANNED"], "with a grasp")
	await track.close()
