"""Objects on the server: created from a mesh, changed when they differ, with the grips that are known of them."""

import base64
import hashlib
import re

from .connect import GraspError

# The label by which objects of this add-on are known: a hash of the mesh that was sent.
_MESH_LABEL = "blender-mesh"
_CHANGEABLE = ("massKg", "centerOfMass", "friction", "regions")


def object_name(text):
    """A valid name for an object that its user calls `text`."""
    words = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    return f"objects/{(words if words[:1].isalpha() else f'object-{words}')[:63].rstrip('-')}"


def find(client, name):
    """The object as it is on the server, or None."""
    try:
        return client.call("ObjectService/GetObject", {"name": name})
    except GraspError as error:
        if error.code != "not_found":
            raise
        return None


def ensure(client, wanted, mesh):
    """Makes the server have an object with these fields, of this file; returns it.

    An object of that name which another program made is never replaced: GraspError "already_exists".
    """
    digest = hashlib.sha256(mesh + repr([wanted.get(key) for key in ("metersPerUnit", "zUp", "parts")]).encode()).hexdigest()
    wanted = {**wanted, "labels": {**wanted.get("labels", {}), _MESH_LABEL: digest[:32]}}
    present = find(client, wanted["name"])
    if present is not None:
        label = present.get("labels", {}).get(_MESH_LABEL)
        if label is None:
            raise GraspError("already_exists", f"{wanted['name']} is another program's: choose another name")
        if label == digest[:32]:
            return _changed(client, present, wanted)
        wanted.setdefault("knownGrips", present.get("knownGrips", []))
        client.call("ObjectService/DeleteObject", {"name": wanted["name"], "etag": present["etag"]})
    request = {"object": wanted, "mesh": base64.b64encode(mesh).decode()}
    return client.call("ObjectService/CreateObject", request)


def _changed(client, present, wanted):
    """The object after an update of what differs."""
    changes = {field: wanted[field] for field in _CHANGEABLE if field in wanted and not _same(present.get(field), wanted[field])}
    if not changes:
        return present
    update = {"object": {"name": wanted["name"], "etag": present["etag"], **changes}, "updateMask": ",".join(changes)}
    return client.call("ObjectService/UpdateObject", update)


def _same(present, wanted):
    """Whether values agree; numbers come back in single precision, and zeros and empty lists are left out."""
    if isinstance(wanted, dict):
        return all(_same((present or {}).get(key), wanted.get(key)) for key in {*(present or {}), *wanted})
    if isinstance(wanted, list):
        return len(present or ()) == len(wanted) and all(map(_same, present or (), wanted))
    if isinstance(wanted, (int, float)):
        return abs((present or 0) - wanted) <= 1e-6 * abs(wanted)
    return present == wanted


def set_known_grips(client, name, change):
    """Replaces an object's known grips by change(list of them), unless another program changes them meanwhile; returns the
    object."""
    present = client.call("ObjectService/GetObject", {"name": name})
    grips = change(present.get("knownGrips", []))
    update = {"object": {"name": name, "etag": present["etag"], "knownGrips": grips}, "updateMask": "knownGrips"}
    return client.call("ObjectService/UpdateObject", update)
