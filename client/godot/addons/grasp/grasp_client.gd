class_name GraspClient
extends Node
## Asks a Grasp server, by JSON over HTTP, in Godot's convention.
##
## Requests are dictionaries with the names of the contract's JSON; [method GraspJson.pose] makes poses of transforms. Await calls; any
## number may be in flight. Errors are in the reply, and [signal failed] reports them, too.
## [codeblock]
## var answer := await client.find_grasp({"holdout": {"object": "objects/scissors"}})
## if answer.error:
##     print(answer.error)
## elif answer.grasp:
##     GraspSkeleton.new(skeleton).pose(answer.grasp.hand)
## [/codeblock]

## A call failed.
signal failed(error: GraspError)

const _SERVICE := "grasp.v1.GraspService/"

## The server's address.
@export var url := "http://[::1]:50051"
## Seconds after which a call ends. The server knows, and ends its search in time.
@export var timeout := 30.0

## The certificates that https trusts. Null: the system's.
var tls: TLSOptions

var _idle: Array[GraspConnection] = []


## Searches for a grasp. [param request] is a [code]FindGraspRequest[/code]:
## [codeblock]
## {
##     "holdout": {
##         "object": "objects/scissors",
##         "clientFromObject": GraspJson.pose(scissors.global_transform),
##         "presentingHand": GraspTracker.presenting_hand(tracker, origin.global_transform),
##     },
##     "receiver": {"handedness": "HANDEDNESS_LEFT"},
## }
## [/codeblock]
func find_grasp(request: Dictionary) -> GraspAnswer:
	return GraspAnswer.from_reply(await ask(_SERVICE + "FindGrasp", in_godots_convention(request)))


## Calls [param found] with a [GraspAnswer] for every better grasp, or for the best [code]alternatives[/code]. Returns the last one, with the
## outcome and the report, or with the error. [param request] is a [code]StreamGraspsRequest[/code].
func stream_grasps(request: Dictionary, found: Callable) -> GraspAnswer:
	var last: Array[GraspReply] = [GraspReply.new()]
	var receive := func(message: Dictionary) -> void:
		last[0].message = message
		if message.has("grasps"):
			found.call(GraspAnswer.from_reply(last[0]))
	last[0].error = await ask_stream(_SERVICE + "StreamGrasps", in_godots_convention(request), receive)
	return GraspAnswer.from_reply(last[0])


## Begins to hold on to a grasp while giver and object move. [param track] is a [code]Track[/code]: poses and the giver come with frames.
## [member GraspTrack.error] of the answer says if that failed.
func create_track(track: Dictionary) -> GraspTrack:
	var request := in_godots_convention(track)
	# Of a grasp that is kept, only the wrists come: GraspTrack knows the rest.
	request.output.changesOnly = true
	return GraspTrack.new(self, await ask(_SERVICE + "CreateTrack", request))


## The mesh of an object, as searches use it, with its frame as the node's; null if the call failed.
func get_mesh(object: String) -> Node3D:
	var glb := PackedByteArray()
	var append := func(message: Dictionary) -> void:
		glb.append_array(GraspJson.read_bytes(message.get("piece", "")))
	if await ask_stream("grasp.v1.ObjectService/GetMesh", {"name": object}, append):
		return null
	var state := GLTFState.new()
	var document := GLTFDocument.new()
	if document.append_from_buffer(glb, "", state) != OK:
		return null
	return document.generate_scene(state)


## The bones of a rig; null if the call failed.
func get_rig(rig: String) -> GraspRig:
	var reply := await ask("grasp.v1.HandRigService/GetRig", {"name": rig})
	return null if reply.error else GraspRig.from_json(reply.message)


## Calls any method that answers with one message, such as "grasp.v1.ObjectService/CreateObject", with a request as it is.
func ask(method: String, request: Dictionary) -> GraspReply:
	var reply := GraspReply.new()
	var answer := PackedByteArray()
	reply.error = await _post(method, "application/json", _json(request), func(piece): answer.append_array(piece))
	if not reply.error:
		var message: Variant = JSON.parse_string(answer.get_string_from_utf8())
		if message is Dictionary:
			reply.message = message
		else:
			reply.error = GraspError.local("internal", "the answer is no JSON")
	if reply.error:
		failed.emit(reply.error)
	return reply


## Calls any method that answers with a stream, and [param received] with each message as it comes. Null if the stream ended well.
func ask_stream(method: String, request: Dictionary, received: Callable) -> GraspError:
	var envelopes := GraspEnvelopes.new(received)
	var body := GraspEnvelopes.wrap(_json(request))
	var error := await _post(method, "application/connect+json", body, envelopes.push)
	if not error:
		error = envelopes.error()
	if error:
		failed.emit(error)
	return error


## A copy of a request that says its convention, which holds for its answer, too.
static func in_godots_convention(request: Dictionary) -> Dictionary:
	var copy := request.duplicate(true)
	copy.get_or_add("output", {}).convention = "CONVENTION_GODOT"
	return copy


## Posts a body, and calls [param received] with each piece of the answer.
func _post(method: String, content_type: String, body: PackedByteArray, received: Callable) -> GraspError:
	var connection: GraspConnection = _idle.pop_back() if _idle else GraspConnection.new()
	var refusal := PackedByteArray()
	var receive := func(piece: PackedByteArray) -> void:
		if connection.status == 200:
			received.call(piece)
		else:
			refusal.append_array(piece)
	var headers: PackedStringArray = [
		"Content-Type: " + content_type, "Connect-Protocol-Version: 1", "Connect-Timeout-Ms: %d" % (timeout * 1000),
	]
	if not await connection.post(GraspUrl.new(url, tls), method, headers, body, timeout, receive):
		if connection.is_late:
			return GraspError.local("deadline_exceeded", "no answer from %s within %s s" % [url, timeout])
		return GraspError.local("unavailable", "no answer from " + url)
	_idle.append(connection)
	if connection.status == 200:
		return null
	var error: Variant = JSON.parse_string(refusal.get_string_from_utf8())
	if error is Dictionary:
		return GraspError.from_json(error)
	return GraspError.local("unknown", "HTTP status %d from %s" % [connection.status, url])


static func _json(message: Dictionary) -> PackedByteArray:
	return JSON.stringify(message, "", false, true).to_utf8_buffer()
