class_name GraspTrack
extends RefCounted
## Holds on to a grasp while giver and object move: takes a frame whenever there is one, sends the latest as soon as the answer to the
## one before is there, and emits every answer. From [method GraspClient.create_track]; ends by [method close].

## A frame was answered.
signal answered(answer: Answer)

## Why the track could not be created, or the last frame was not answered; null if all is well.
var error: GraspError
## The track's name; empty if it could not be created.
var name := ""
## The grasp that holds now; null without one.
var grasp: Grasp

var _client: GraspClient
## The last grasp that came as a whole.
var _whole: Grasp
var _next: Dictionary = {}
var _sequence := 0
var _is_sending := false


## The answer to a frame.
class Answer:
	## The number of the frame, from 1.
	var sequence := 0
	## "KEPT", "ADJUSTED", "REPLANNED", "NONE" or "ABORTED"; empty for a frame that was overtaken.
	var status := ""
	## The grasp; null without one.
	var grasp: Grasp
	## The open hand, drawn back from the object; null unless the status is "ABORTED".
	var withdrawal: GraspHand
	## Faults of the frame, such as a hand that has lost tracking, which was taken where it was last.
	var warnings := PackedStringArray()
	## The whole message.
	var message: Dictionary = {}


func _init(client: GraspClient, created: GraspReply) -> void:
	_client = client
	error = created.error
	name = created.message.get("name", "")


## Sends a frame, a [code]TrackFrame[/code] without track and sequence, or keeps it until the frame before is answered. A later one takes
## its place. A giver's hand that has lost tracking may be sent: the server takes it where it was last.
## [codeblock]
## track.push({"holdout": {
##     "clientFromObject": GraspJson.pose(object.global_transform),
##     "presentingHand": GraspTracker.presenting_hand(tracker, origin.global_transform),
## }})
## [/codeblock]
func push(frame: Dictionary) -> void:
	_next = frame.duplicate(true)
	_next.captureTime = "%.6fs" % (Time.get_ticks_usec() * 1e-6)
	if not _is_sending:
		_send()


## Ends the track on the server.
func close() -> void:
	_next = {}
	if name:
		var request := {"name": name}
		name = ""
		await _client.ask("grasp.v1.GraspService/DeleteTrack", request)


func _send() -> void:
	_is_sending = true
	while _next and name:
		var frame := _next
		_next = {}
		_sequence += 1
		frame.track = name
		frame.sequence = _sequence
		var reply := await _client.ask("grasp.v1.GraspService/PushFrame", frame)
		error = reply.error
		if not error:
			answered.emit(_read(reply.message))
		elif error.code == "not_found":
			name = ""
	_is_sending = false


func _read(message: Dictionary) -> Answer:
	var answer := Answer.new()
	var current: Dictionary = message.get("current", {})
	answer.message = message
	answer.sequence = int(message.get("sequence", "0"))
	answer.status = current.get("status", "").trim_prefix("CURRENT_GRASP_STATUS_")
	answer.warnings = message.get("warnings", [])
	if current.has("withdrawal"):
		answer.withdrawal = GraspHand.from_json(current.withdrawal)
	if message.has("grasp"):
		answer.grasp = Grasp.from_json(message.grasp)
		if not answer.grasp.hand.joints.is_empty():
			_whole = answer.grasp
		elif _whole:
			# Of a kept grasp only wrists and score came.
			var kept := Grasp.from_json(_whole.message)
			kept.hand = _whole.hand.at_wrist(answer.grasp.hand.client_from_wrist)
			kept.score = answer.grasp.score
			answer.grasp = kept
	if answer.status:
		grasp = answer.grasp
	return answer
