extends Node3D
## A person holds a remote control out and moves it about; a hand comes, takes it, and holds on to it.
##
## Runs from this repository, whose assets it reads, and with a server at the URL of the node GraspClient.

## The hand has taken the object.
signal taken

const _ASSETS := "res://../../assets/"

## A file of assets/holdouts, without ".json".
@export var holdout := "remote-genhold3"
## How the giver's hand looks, and the receiving one.
@export var giver_skin: Material
@export var receiver_skin: Material
@export var object_surface: Material

var _object_name := ""
var _world_from_object := Transform3D.IDENTITY
var _giver: GraspHand
var _giver_bones: GraspSkeleton
var _track: GraspTrack
var _time := 0.0

@onready var _client: GraspClient = $GraspClient
@onready var _player: GraspPlayer = $GraspPlayer
@onready var _object: Node3D = $Object


func _ready() -> void:
	_client.failed.connect(func(error: GraspError) -> void: push_error(str(error)))
	set_process(false)
	_read_holdout()
	var mesh := await _client.get_mesh(_object_name)
	var rig := await _client.get_rig(_giver.rig)
	if not mesh or not rig:
		return
	_object.add_child(mesh)
	_paint(mesh, object_surface)
	rig.pose(_giver)
	_giver_bones = GraspSkeleton.new(_show_hand(_giver, giver_skin, "Giver"))
	set_process(true)
	await _take()


func _process(delta: float) -> void:
	_time += delta
	var sway := Transform3D(Basis(Vector3.UP, 0.25 * sin(_time)), Vector3(0.05 * sin(0.8 * _time), 0.03 * sin(1.3 * _time), 0))
	_object.transform = sway * _world_from_object
	_giver_bones.pose(_giver.at_object(_object.global_transform))
	if _track:
		_track.push({"holdout": _holdout()})


func _exit_tree() -> void:
	if _track:
		_track.close()


## Asks for a grasp, plays the motion to it, and holds on to it.
func _take() -> void:
	var answer := await _client.find_grasp({"holdout": _holdout(), "output": {"keyFrames": true}})
	if not answer.grasp:
		push_warning("no grasp: %s" % answer.report)
		return
	var hand := answer.grasp.hand
	_player.object = _object
	_player.skeleton = _show_hand(hand, receiver_skin, "Receiver")
	_player.play(answer.grasp)
	await _player.arrived
	taken.emit()
	_track = await _client.create_track({
		"holdout": {"object": _object_name},
		"receiver": {"handedness": "HANDEDNESS_LEFT" if hand.handedness == GraspHand.LEFT else "HANDEDNESS_RIGHT"},
		"current": hand.to_json(),
	})
	_track.answered.connect(_follow)


func _follow(answer: GraspTrack.Answer) -> void:
	if answer.withdrawal:
		_player.move_to(answer.withdrawal)
	elif answer.grasp and answer.status != "KEPT":
		_player.move_to(answer.grasp.hand)


## The holdout as it is now.
func _holdout() -> Dictionary:
	return {
		"object": _object_name,
		"clientFromObject": GraspJson.pose(_object.global_transform),
		"presentingHand": {"pose": _giver.at_object(_object.global_transform).to_json()},
	}


## Reads the object's pose and the giver's hand. Wrists in these files have Godot's axes.
func _read_holdout() -> void:
	var file: Dictionary = JSON.parse_string(FileAccess.get_file_as_string(_ASSETS + "holdouts/%s.json" % holdout))
	_object_name = "objects/" + file.object
	_world_from_object = _read_pose(file.world_from_object)
	_giver = GraspHand.new()
	_giver.rig = "rigs/" + file.giver_rig
	_giver.handedness = GraspHand.LEFT if file.giver_handedness == "left" else GraspHand.RIGHT
	_giver.client_from_wrist = _read_pose(file.world_from_giver_wrist)
	_giver.object_from_wrist = _world_from_object.affine_inverse() * _giver.client_from_wrist
	for digit in GraspHand.DIGITS.size():
		var angles: Dictionary = file.giver_digits[digit]
		_giver.digits[digit] = [angles.base_yaw, angles.base_pitch, angles.second_pitch, angles.third_pitch]
	_object.transform = _world_from_object


func _read_pose(pose: Dictionary) -> Transform3D:
	var p: Array = pose.position
	var q: Array = pose.orientation
	return Transform3D(Basis(Quaternion(q[0], q[1], q[2], q[3]).normalized()), Vector3(p[0], p[1], p[2]))


## Adds the model of a hand as a node of this name.
func _show_hand(hand: GraspHand, skin: Material, node_name: String) -> Skeleton3D:
	var side := "left" if hand.handedness == GraspHand.LEFT else "right"
	var state := GLTFState.new()
	var document := GLTFDocument.new()
	document.append_from_file(_ASSETS + "hands/%s_%s.glb" % [hand.rig.trim_prefix("rigs/"), side], state)
	var model := document.generate_scene(state)
	model.name = node_name
	add_child(model)
	_paint(model, skin)
	return model.find_children("*", "Skeleton3D", true, false)[0]


func _paint(model: Node, material: Material) -> void:
	for part: MeshInstance3D in model.find_children("*", "MeshInstance3D", true, false):
		part.material_override = material
