extends GraspCase
## The sample as a person sees it: saves pictures before and after the giver has moved, and looks for hands and object in them.
##
## Argument: the folder for the pictures.

## Least share of the picture for each of them.
const LEAST := 0.005


func run() -> void:
	Engine.max_fps = 0
	var handover: Node3D = load("res://demo/handover.tscn").instantiate()
	var its_client: GraspClient = handover.get_node("GraspClient")
	its_client.url = client.url
	its_client.failed.connect(func(error: GraspError) -> void: expect(false, str(error)))
	root.add_child(handover)
	await handover.taken
	var hand := (handover.get_node("GraspPlayer") as GraspPlayer).hand
	var object: Node3D = handover.get_node("Object")
	var before := object.position
	await look(handover, "taken.png")
	await create_timer(1.5).timeout
	expect(object.position.distance_to(before) > 0.01, "the giver moves")
	await look(handover, "moved.png")
	var palm := hand.at_object(object.global_transform).joints[XRHandTracker.HAND_JOINT_PALM].origin
	var skeleton := (handover.get_node("GraspPlayer") as GraspPlayer).skeleton
	var wrist := skeleton.global_transform * skeleton.get_bone_global_pose(skeleton.find_bone("wrist")).origin
	expect(wrist.distance_to(palm) < 0.1, "the hand moves with it")


## Saves a picture, and measures how much of it changes if each of the three is hidden.
func look(handover: Node3D, file: String) -> void:
	handover.set_process(false)
	var seen := await picture()
	seen.save_png(arguments[2].path_join(file))
	for name: String in ["Giver", "Receiver", "Object"]:
		var shown: Node3D = handover.get_node(name)
		shown.hide()
		var without := await picture()
		shown.show()
		var changed := 0
		for y in range(0, seen.get_height(), 4):
			for x in range(0, seen.get_width(), 4):
				changed += 1 if seen.get_pixel(x, y) != without.get_pixel(x, y) else 0
		var share := changed * 16.0 / (seen.get_width() * seen.get_height())
		print("%s: %.1f %% of %s" % [name, share * 100, file])
		expect(share > LEAST, "%s is seen in %s" % [name, file])
	handover.set_process(true)


func picture() -> Image:
	await process_frame
	await RenderingServer.frame_post_draw
	return root.get_texture().get_image()
