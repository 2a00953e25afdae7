class_name GraspJson
## Vectors, quaternions and poses of the service's messages, as protobuf writes them in JSON: fields that are 0 are absent.


## A pose of a request. Scale is left out: messages have rigid transforms.
static func pose(transform: Transform3D) -> Dictionary:
	return {
		"position": vector(transform.origin),
		"orientation": quaternion(transform.basis.get_rotation_quaternion()),
	}


## A point or a direction of a request.
static func vector(v: Vector3) -> Dictionary:
	return {"x": v.x, "y": v.y, "z": v.z}


## An orientation of a request.
static func quaternion(q: Quaternion) -> Dictionary:
	return {"x": q.x, "y": q.y, "z": q.z, "w": q.w}


## Reads a pose of an answer, without a change of convention. Absent: the identity.
static func read_pose(message: Dictionary) -> Transform3D:
	var orientation := Quaternion.IDENTITY
	if message.has("orientation"):
		var q: Dictionary = message.orientation
		orientation = Quaternion(q.get("x", 0.0), q.get("y", 0.0), q.get("z", 0.0), q.get("w", 0.0))
	return Transform3D(Basis(orientation.normalized()), read_vector(message.get("position", {})))


## Reads a point or a direction of an answer.
static func read_vector(message: Dictionary) -> Vector3:
	return Vector3(message.get("x", 0.0), message.get("y", 0.0), message.get("z", 0.0))


## Reads bytes of an answer, whether or not their base64 is padded.
static func read_bytes(base64: String) -> PackedByteArray:
	return Marshalls.base64_to_raw(base64 + "=".repeat(posmod(-base64.length(), 4)))
