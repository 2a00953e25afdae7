class_name GraspConvention
extends RefCounted
## An engine's axes, lengths and order of joints, converted to Godot's.
##
## Answers to this add-on are in Godot's convention. Other ones come with grasps that were saved or replicated by other engines. Frames of
## Godot and OpenXR differ only in the axes of hand joints: those of [XRHandTracker] are turned by [constant JOINT_TURN].

## Numbers of the contract's enum [code]Convention[/code].
enum { OPENXR = 1, UNITY = 2, UNREAL = 3, GODOT = 4, UNITY_FLIP_X = 5, UNREAL_XZY = 6 }

## Their names in JSON, by number.
const NAMES: Array[String] = [
	"CONVENTION_UNSPECIFIED", "CONVENTION_OPENXR", "CONVENTION_UNITY", "CONVENTION_UNREAL", "CONVENTION_GODOT",
	"CONVENTION_UNITY_FLIP_X", "CONVENTION_UNREAL_XZY",
]

## Axes of an [XRHandTracker]'s joint in the OpenXR joint's, and the other way around: a half turn about (0, -1, 1).
const JOINT_TURN := Basis(Vector3.LEFT, Vector3.FORWARD, Vector3.DOWN)

## The engine's axes in Godot's.
var axes := Basis.IDENTITY
## The axes of objects' frames in Godot's.
var object_axes := Basis.IDENTITY
## Meters per unit of length.
var meters := 1.0

var _joint_turn := JOINT_TURN
var _is_palm_second := false


## The convention of this number; unspecified is OpenXR's.
static func of(number: int) -> GraspConvention:
	var convention := GraspConvention.new()
	match number:
		UNITY, UNITY_FLIP_X:
			convention.axes = Basis(Vector3.RIGHT, Vector3.UP, Vector3.FORWARD)
			convention._is_palm_second = true
		UNREAL, UNREAL_XZY:
			convention.axes = Basis(Vector3.FORWARD, Vector3.RIGHT, Vector3.UP)
			convention.meters = 0.01
		GODOT:
			convention._joint_turn = Basis.IDENTITY
	convention.object_axes = convention.axes
	match number:
		UNITY_FLIP_X:
			convention.object_axes = Basis(Vector3.LEFT, Vector3.UP, Vector3.BACK)
		UNREAL_XZY:
			convention.object_axes = Basis(Vector3.RIGHT, Vector3.BACK, Vector3.UP)
	return convention


## The convention of this name in JSON; absent is OpenXR's.
static func named(name: String) -> GraspConvention:
	return of(NAMES.find(name))


## The pose of a hand joint or wrist in the client's frame.
func joint(pose: Transform3D) -> Transform3D:
	return Transform3D(axes * pose.basis * axes.transposed() * _joint_turn, axes * pose.origin * meters)


## The pose of a hand joint or wrist in the object's frame.
func joint_at_object(pose: Transform3D) -> Transform3D:
	return Transform3D(object_axes * pose.basis * axes.transposed() * _joint_turn, point_at_object(pose.origin))


## A point in the object's frame.
func point_at_object(point: Vector3) -> Vector3:
	return object_axes * point * meters


## A direction, or a force, in the object's frame.
func direction_at_object(direction: Vector3) -> Vector3:
	return object_axes * direction


## The index in [enum XRHandTracker.HandJoint] of the joint at a place of the convention's list.
func joint_index(place: int) -> int:
	return 1 - place if _is_palm_second and place < 2 else place
