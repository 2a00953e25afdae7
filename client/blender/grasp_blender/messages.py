"""Parts of messages as JSON, without zeros and absent fields, and answers in one form: OpenXR's axes, all in the
object's frame."""

from . import axes
from .axes import CONVENTIONS, composed, inverse
from .connect import GraspError

DIGITS = ("thumb", "index", "middle", "ring", "little")
ANGLES = ("baseYaw", "basePitch", "secondPitch", "thirdPitch")


def vector(json):
    """(x, y, z) of a Vector3."""
    return tuple(float((json or {}).get(axis, 0)) for axis in "xyz")


def vector_json(v):
    """A Vector3."""
    return dict(zip("xyz", v))


def pose(json):
    """A pose of a Pose; the identity of None."""
    json = json or {}
    turn = json.get("orientation")
    orientation = tuple(float(turn.get(part, 0)) for part in "xyzw") if turn else axes.IDENTITY[1]
    return vector(json.get("position")), orientation


def pose_json(pose):
    """A Pose."""
    return {"position": vector_json(pose[0]), "orientation": dict(zip("xyzw", pose[1]))}


def seconds(duration):
    """The seconds of a Duration such as "0.5s"."""
    return float(duration.rstrip("s"))


def convention_of(message):
    """The convention that a hand or output options name. Raises GraspError if there is no such convention."""
    convention = message.get("convention", "CONVENTION_OPENXR").replace("UNSPECIFIED", "OPENXR")
    if convention not in CONVENTIONS:
        raise GraspError("invalid_argument", f"convention: is {convention}; it must be one of {', '.join(CONVENTIONS)}")
    return convention


def joints(json, convention):
    """The joints of a HandPose or HandJoints as 26 poses in OpenXR's order and axes, None for missing ones; the palm is None
    for the 25 of WebXR."""
    engine = CONVENTIONS[convention]
    read = [engine.joint_to_openxr(pose(joint["pose"])) if joint.get("pose") else None for joint in json.get("joints", ())]
    if len(read) == 25:
        return [None, *read]
    return [read[joint] for joint in engine.first_joints] + read[2:] if read else []


def hand_in_object(hand, convention, client_from_object):
    """A HandPose in OpenXR's axes with `objectFromWrist`, digits and, of an answer, `joints`: 26 poses in the object's frame.
    client_from_object is in OpenXR's axes."""
    convention = convention_of({"convention": hand.get("convention", convention)})
    engine = CONVENTIONS[convention]
    object_from_client = inverse(client_from_object)
    if "objectFromWrist" in hand:
        wrist = engine.joint_in_object_to_openxr(pose(hand["objectFromWrist"]))
    else:
        wrist = composed(object_from_client, engine.joint_to_openxr(pose(hand["clientFromWrist"])))
    kept = {key: hand[key] for key in ("rig", "handedness", "scale", *DIGITS) if key in hand}
    result = {**kept, "objectFromWrist": pose_json(wrist), "convention": "CONVENTION_OPENXR"}
    if found := joints(hand, convention):
        result["joints"] = [joint and composed(object_from_client, joint) for joint in found]
    if model := hand.get("model"):
        root = engine.object_to_openxr(pose(model[0]["pose"]))
        result["model"] = [(model[0]["node"], composed(object_from_client, root))]
        result["model"] += [(node["node"], pose(node["pose"])[1]) for node in model[1:]]
    return result


def grasp_in_object(grasp, convention="CONVENTION_OPENXR", client_from_object=axes.IDENTITY):
    """A Grasp in OpenXR's axes, all in the object's frame. client_from_object is in OpenXR's axes."""
    engine = CONVENTIONS[convention]
    contacts = []
    for contact in grasp.get("contacts", ()):
        position = engine.in_object_to_openxr(vector(contact["position"]))
        contacts.append(
            {
                "digit": contact.get("digit", "DIGIT_UNSPECIFIED"),
                "phalanx": contact.get("phalanx", 0),
                "position": tuple(part / engine.units_per_meter for part in position),
                "normal": engine.in_object_to_openxr(vector(contact.get("normal"))),
                "force": engine.in_object_to_openxr(vector(contact.get("force"))),
            }
        )
    elbow = grasp.get("arm", {}).get("clientElbow")
    if elbow is not None:
        elbow = composed(inverse(client_from_object), (engine.point_to_openxr(vector(elbow)), axes.IDENTITY[1]))[0]
    return {
        "hand": hand_in_object(grasp["hand"], convention, client_from_object),
        "elbow": elbow,
        "contacts": contacts,
        "type": grasp.get("type", "GRASP_TYPE_UNSPECIFIED").removeprefix("GRASP_TYPE_").replace("_", " ").capitalize(),
        "score": grasp.get("score", 0.0),
        "keyFrames": [
            (frame["kind"], hand_in_object(frame["hand"], convention, client_from_object))
            for frame in grasp.get("keyFrames", ())
        ],
    }


def hand_message(hand):
    """A hand in the object's frame as a HandPose for a request."""
    return {key: value for key, value in hand.items() if key not in ("joints", "model")}
