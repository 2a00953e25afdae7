extends GraspCase
## Errors: with violations, of unknown things, of servers that are not there, and of those that do not answer in time.

var reported: Array[GraspError] = []


func run() -> void:
	client.failed.connect(reported.append)
	var answer := await client.find_grasp({
		"holdout": {"object": "objects/scissors", "scale": 9.0, "massKg": -1.0},
		"receiver": {"scale": 100},
	})
	print(answer.error)
	expect(answer.error != null and answer.grasp == null, "a wrong request fails")
	expect(answer.error.code == "invalid_argument" and answer.error.reason == "INVALID_REQUEST", "code and reason")
	var fields := answer.error.violations.map(func(violation: GraspError.Violation) -> String: return violation.field)
	expect(fields == ["holdout.scale", "holdout.mass_kg", "receiver.scale"], "all fields are named: %s" % [fields])
	expect("0.25" in answer.error.violations[0].description, "a violation has the allowed values")
	expect(reported == [answer.error], "the signal reports it, too")

	var unknown := await client.find_grasp({"holdout": {"object": "objects/nowhere"}})
	print(unknown.error)
	expect(unknown.error.code == "not_found" and unknown.error.reason == "OBJECT_NOT_FOUND", "an unknown object")
	expect(await client.get_rig("rigs/nowhere") == null and reported.size() == 3, "an unknown rig")
	var track := await client.create_track({"holdout": {"object": "objects/nowhere"}})
	expect(track.error != null and track.name == "", "a track of an unknown object")

	var nobody := GraspClient.new()
	root.add_child(nobody)
	nobody.url = "http://127.0.0.1:1"
	print((await nobody.ask("grasp.v1.GraspService/FindGrasp", {})).error)
	expect((await nobody.ask("grasp.v1.GraspService/FindGrasp", {})).error.code == "unavailable", "no server")

	var mute := TCPServer.new()
	mute.listen(0, "127.0.0.1")
	nobody.url = "http://127.0.0.1:%d" % mute.get_local_port()
	nobody.timeout = 0.3
	var late := await nobody.find_grasp({})
	print(late.error)
	expect(late.error.code == "deadline_exceeded", "a server that does not answer")

	# The connection is good for further calls.
	expect((await client.find_grasp({"holdout": {"object": "objects/scissors"}})).grasp != null, "a call after errors")
