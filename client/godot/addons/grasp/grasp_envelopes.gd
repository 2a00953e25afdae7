class_name GraspEnvelopes
extends RefCounted
## The messages of a stream, each in an envelope: a byte of flags, four of the length (big-endian), and JSON.

const _HEADER_SIZE := 5
const _END_OF_STREAM := 2

var _received: Callable
var _bytes := PackedByteArray()
var _end: Variant


## Calls [param received] with each message.
func _init(received: Callable) -> void:
	_received = received


## The only message of a request.
static func wrap(message: PackedByteArray) -> PackedByteArray:
	var header := StreamPeerBuffer.new()
	header.big_endian = true
	header.put_u8(0)
	header.put_u32(message.size())
	return header.data_array + message


## Takes the next bytes of the answer.
func push(piece: PackedByteArray) -> void:
	_bytes.append_array(piece)
	while _bytes.size() >= _HEADER_SIZE:
		var size := _bytes[1] << 24 | _bytes[2] << 16 | _bytes[3] << 8 | _bytes[4]
		if _bytes.size() < _HEADER_SIZE + size:
			return
		var message: Variant = JSON.parse_string(_bytes.slice(_HEADER_SIZE, _HEADER_SIZE + size).get_string_from_utf8())
		if _bytes[0] & _END_OF_STREAM:
			_end = message
		elif message is Dictionary:
			_received.call(message)
		_bytes = _bytes.slice(_HEADER_SIZE + size)


## Why the stream did not end well; null if it did.
func error() -> GraspError:
	if _end is not Dictionary:
		return GraspError.local("unavailable", "the stream ended too early")
	return GraspError.from_json(_end.error) if _end.has("error") else null
