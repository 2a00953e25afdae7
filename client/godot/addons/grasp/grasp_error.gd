class_name GraspError
extends RefCounted
## Why a call failed. [code]print(error)[/code] writes all of it.

## The code of gRPC in lower case, such as "invalid_argument", "not_found" or "unavailable".
var code := ""
## The cause in words.
var message := ""
## A reason of the contract's enum [code]ErrorReason[/code], without its prefix; empty if the server does not say.
var reason := ""
## Every wrong field of the request at once, with its value and the allowed ones.
var violations: Array[Violation] = []
## Seconds after which to try again; 0 if that is no use.
var retry_delay := 0.0


## A wrong field.
class Violation:
	## Its path in the request, such as "holdout.object".
	var field := ""
	## Its value and the allowed ones.
	var description := ""

	func _to_string() -> String:
		return "%s: %s" % [field, description]


## A call that did not reach the server, or ended without an answer.
static func local(error_code: String, cause: String) -> GraspError:
	var error := GraspError.new()
	error.code = error_code
	error.message = cause
	return error


## Reads an error of the Connect protocol.
static func from_json(json: Dictionary) -> GraspError:
	var error := local(json.get("code", "unknown"), json.get("message", ""))
	for detail: Dictionary in json.get("details", []):
		var fields := _fields(GraspJson.read_bytes(detail.get("value", "")))
		match detail.get("type"):
			"google.rpc.ErrorInfo":
				error.reason = _text(fields, 1)
			"google.rpc.BadRequest":
				for value: PackedByteArray in fields.get(1, []):
					var violation := Violation.new()
					var parts := _fields(value)
					violation.field = _text(parts, 1)
					violation.description = _text(parts, 2)
					error.violations.append(violation)
			"google.rpc.RetryInfo":
				for value: PackedByteArray in fields.get(1, []):
					var duration := _fields(value)
					error.retry_delay = duration.get(1, [0])[-1] + duration.get(2, [0])[-1] * 1e-9
	return error


func _to_string() -> String:
	return "\n  ".join(["%s: %s" % [code, message]] + violations)


static func _text(fields: Dictionary, number: int) -> String:
	return (fields[number][-1] as PackedByteArray).get_string_from_utf8() if fields.has(number) else ""


## The fields of a message in protobuf's binary form, in which the Connect protocol sends details: all values by number. Details have
## integers, and texts and messages as bytes.
static func _fields(bytes: PackedByteArray) -> Dictionary:
	var fields := {}
	var stream := StreamPeerBuffer.new()
	stream.data_array = bytes
	while stream.get_available_bytes() > 0:
		var key := _varint(stream)
		var value: Variant = _varint(stream)
		if key & 7 == 2:
			value = stream.get_data(mini(value, stream.get_available_bytes()))[1]
		elif key & 7 != 0:
			break
		fields.get_or_add(key >> 3, []).append(value)
	return fields


static func _varint(stream: StreamPeerBuffer) -> int:
	var value := 0
	for shift in range(0, 64, 7):
		var byte := stream.get_u8()
		value |= (byte & 127) << shift
		if byte < 128:
			break
	return value
