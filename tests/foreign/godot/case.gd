class_name GraspCase
extends SceneTree
## A test of the add-on in a running engine: prints its measurements, and ends with 0 if all are as expected.
##
## Arguments after "--": the server's URL, the folder of this repository, and those of the case.

var client := GraspClient.new()
var repository := ""
var arguments := PackedStringArray()
var _failures := 0


func _initialize() -> void:
	Engine.max_fps = 240
	arguments = OS.get_cmdline_user_args()
	client.url = arguments[0]
	repository = arguments[1]
	root.add_child(client)
	_run_to_the_end()


## The case.
func run() -> void:
	pass


func expect(condition: bool, text: String) -> void:
	if not condition:
		_failures += 1
		print("FAILED: " + text)


func expect_within(bound: float, value: float, text: String) -> void:
	print("%s: %.6f (at most %s)" % [text, value, bound])
	expect(value <= bound, text)


func read_json(path: String) -> Dictionary:
	return JSON.parse_string(FileAccess.get_file_as_string(repository.path_join(path)))


## A hand of assets/hands, in the tree; answers its skeleton.
func load_hand(name: String) -> Skeleton3D:
	var state := GLTFState.new()
	var document := GLTFDocument.new()
	document.append_from_file(repository.path_join("assets/hands/%s.glb" % name), state)
	var scene := document.generate_scene(state)
	root.add_child(scene)
	return scene.find_children("*", "Skeleton3D", true, false)[0]


## The angle between two orientations, in radians.
static func angle(a: Basis, b: Basis) -> float:
	return a.get_rotation_quaternion().angle_to(b.get_rotation_quaternion())


func _run_to_the_end() -> void:
	await process_frame
	await run()
	print("PASSED" if _failures == 0 else "%d FAILED" % _failures)
	quit(1 if _failures else 0)
