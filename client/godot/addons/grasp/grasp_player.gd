class_name GraspPlayer
extends Node
## Moves a hand: along the key frames of a grasp, and from grasp to grasp while it is tracked. Between them the wrist moves straight
## and fingers turn in their joints, so nothing snaps. The hand stays on its object while that moves.

## The last pose was reached.
signal arrived

## The skeleton to pose.
@export var skeleton: Skeleton3D:
	set(value):
		skeleton = value
		_bones = GraspSkeleton.new(value) if value else null
## The object to stay on. Without one, hands stay where the answer has them.
@export var object: Node3D
## A tracker to pose, too.
var tracker: XRHandTracker
## The hand as it is now; null before the first.
var hand: GraspHand

var _bones: GraspSkeleton
var _from: GraspHand
var _stages: Array[GraspHand] = []
var _seconds := 0.0
var _elapsed := 0.0


## Plays the key frames of a grasp from the first on, or moves to its hand if it has none; [param seconds] from each to the next.
func play(grasp: Grasp, seconds := 0.5) -> void:
	if not grasp.key_frames.is_empty():
		hand = grasp.key_frames[0]
	_start(grasp.key_frames.slice(1) if grasp.key_frames else [grasp.hand], seconds)


## Moves from where the hand is now.
func move_to(to: GraspHand, seconds := 0.15) -> void:
	_start([to], seconds)


func _start(stages: Array, seconds: float) -> void:
	_stages.assign(stages)
	_seconds = seconds
	_elapsed = 0.0
	_from = hand if hand else _stages[0]


func _process(delta: float) -> void:
	if not _stages.is_empty():
		_elapsed += delta
		while _stages and _elapsed >= _seconds:
			_elapsed -= _seconds
			_from = _stages.pop_front()
		hand = _from.toward(_stages[0], _elapsed / _seconds) if _stages else _from
		if _stages.is_empty():
			arrived.emit()
	if not hand:
		return
	var shown := hand.at_object(object.global_transform) if object else hand
	if _bones:
		_bones.pose(shown)
	if tracker:
		GraspTracker.pose(tracker, shown)
