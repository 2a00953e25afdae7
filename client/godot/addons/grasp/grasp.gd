class_name Grasp
extends RefCounted
## A hand that holds the object: the contract's [code]Grasp[/code], in meters and Godot's convention.

## The contract's enum [code]GraspType[/code], without its prefix.
const TYPES: Array[String] = [
	"UNSPECIFIED", "LARGE_DIAMETER", "SMALL_DIAMETER", "MEDIUM_WRAP", "ADDUCTED_THUMB", "LIGHT_TOOL", "PRISMATIC_4_FINGER",
	"PRISMATIC_3_FINGER", "PRISMATIC_2_FINGER", "PALMAR_PINCH", "POWER_DISK", "POWER_SPHERE", "PRECISION_DISK",
	"PRECISION_SPHERE", "TRIPOD", "FIXED_HOOK", "LATERAL", "INDEX_FINGER_EXTENSION", "EXTENSION_TYPE", "DISTAL_TYPE",
	"WRITING_TRIPOD", "TRIPOD_VARIATION", "PARALLEL_EXTENSION", "ADDUCTION_GRIP", "TIP_PINCH", "LATERAL_TRIPOD",
	"SPHERE_4_FINGER", "QUADPOD", "SPHERE_3_FINGER", "STICK", "PALMAR", "RING", "VENTRAL", "INFERIOR_PINCER",
]

## The index in [member touching] of the palm; digits are those of [constant GraspHand.DIGITS].
const PALM := 5


## A contact with the object.
class Contact:
	## A point on the surface, in the object's frame.
	var position := Vector3.ZERO
	## The outward unit normal there.
	var normal := Vector3.ZERO
	## The force that the hand applies, in newtons, in the object's frame.
	var force := Vector3.ZERO
	## The index in [constant GraspHand.DIGITS], or [constant Grasp.PALM].
	var digit := PALM
	## The digit's link from the wrist, 1 to 3; 0 for the palm.
	var phalanx := 0
	## The triangle of the mesh.
	var triangle := 0


## The hand.
var hand: GraspHand
## The contacts, thumb first, palm last; empty of an unpacked grasp.
var contacts: Array[Contact] = []
## The digits, and the palm, that touch the object.
var touching := PackedInt32Array()
## One of [constant TYPES].
var type := "UNSPECIFIED"
## Higher is better; NAN if it is not rated.
var score := NAN
## The motion to the grasp, of a request with [code]output.keyFrames[/code]: an open hand drawn back, one at the object, and the grasp.
var key_frames: Array[GraspHand] = []
## Some 55 bytes with the hand, of a request with [code]output.packed[/code], for [method unpack] on other machines.
var packed := PackedByteArray()
## The whole message, in the convention of the answer.
var message: Dictionary = {}


## Reads a grasp of an answer, in any convention.
static func from_json(json: Dictionary) -> Grasp:
	var grasp := Grasp.new()
	var from := GraspConvention.named(json.hand.get("convention", "CONVENTION_GODOT"))
	grasp.message = json
	grasp.hand = GraspHand.from_json(json.hand)
	for sent: Dictionary in json.get("contacts", []):
		var contact := Contact.new()
		contact.position = from.point_at_object(GraspJson.read_vector(sent.get("position", {})))
		contact.normal = from.direction_at_object(GraspJson.read_vector(sent.get("normal", {})))
		contact.force = from.direction_at_object(GraspJson.read_vector(sent.get("force", {})))
		if sent.has("digit"):
			contact.digit = GraspHand.DIGITS.find(sent.digit.trim_prefix("DIGIT_").to_lower())
		contact.phalanx = sent.get("phalanx", 0)
		contact.triangle = sent.get("triangle", 0)
		grasp.contacts.append(contact)
		if contact.digit not in grasp.touching:
			grasp.touching.append(contact.digit)
	grasp.type = json.get("type", "UNSPECIFIED").trim_prefix("GRASP_TYPE_")
	grasp.score = json.get("score", NAN)
	for frame: Dictionary in json.get("keyFrames", []):
		grasp.key_frames.append(GraspHand.from_json(frame.hand))
	grasp.packed = GraspJson.read_bytes(json.get("packed", ""))
	return grasp


## Reads a packed grasp, made in any convention. Its hand has angles and the wrist in the object's frame, which counts as the client's until
## [method GraspHand.at_object]; [method GraspRig.pose] adds the joints. Null if [param bytes] are no grasp of version 1.
static func unpack(bytes: PackedByteArray) -> Grasp:
	if bytes.size() < 22 or bytes[0] != 1:
		return null
	var id_end := 22 + bytes[21]
	var digit_count := 0
	for digit in GraspHand.DIGITS.size():
		digit_count += bytes[1] >> (digit + 1) & 1
	if bytes.size() != id_end + 6 * digit_count:
		return null
	var grasp := Grasp.new()
	var from := GraspConvention.of(bytes[4])
	grasp.packed = bytes
	grasp.type = TYPES[bytes[3]] if bytes[3] < TYPES.size() else TYPES[0]
	for digit in PALM + 1:
		if bytes[2] >> digit & 1:
			grasp.touching.append(digit)
	var position := Vector3(bytes.decode_s16(7), bytes.decode_s16(9), bytes.decode_s16(11)) * pow(2.0, bytes.decode_s8(6))
	var orientation := Quaternion(bytes.decode_s16(13), bytes.decode_s16(15), bytes.decode_s16(17), bytes.decode_s16(19))
	var hand := GraspHand.new()
	hand.rig = "rigs/" + bytes.slice(22, id_end).get_string_from_ascii()
	hand.handedness = GraspHand.RIGHT if bytes[1] & 1 else GraspHand.LEFT
	hand.scale = bytes[5] / 100.0
	hand.object_from_wrist = from.joint_at_object(Transform3D(Basis(orientation.normalized()), position))
	hand.client_from_wrist = hand.object_from_wrist
	var at := id_end
	for digit in GraspHand.DIGITS.size():
		if bytes[1] >> (digit + 1) & 1:
			hand.digits[digit] = _angles(bytes, at) + _angles(bytes, at + 3)
			at += 6
	grasp.hand = hand
	return grasp


static func _angles(bytes: PackedByteArray, at: int) -> PackedFloat32Array:
	var first := bytes[at] | (bytes[at + 1] & 15) << 8
	var second := bytes[at + 1] >> 4 | bytes[at + 2] << 4
	return [(first - 2048) * PI / 2048, (second - 2048) * PI / 2048]
