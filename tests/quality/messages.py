"""Protobuf's JSON, which the client speaks, and the plainer form in which the judge thinks of it.

There, keys are in snake case, vectors and quaternions are lists, durations are numbers of seconds, and names of enumerations'
values have no prefix.
"""

import re

VECTORS = {
    "position", "orientation", "up", "client_shoulder", "client_direction", "client_start", "client_end", "half_extents"
}
# What names of values start with, by the keys of requests that have them.
PREFIXES = {
    "handedness": "HANDEDNESS",
    "convention": "CONVENTION",
    "joint_set": "JOINT_SET",
    "validity": "VALIDITY",
    "strategy": "STRATEGY",
    "hands": "HANDS",
    "choice": "CHOICE",
    "receiver_stance": "RECEIVER_STANCE",
    "must_touch": "DIGIT",
    "must_not_touch": "DIGIT",
    "allowed_grasp_types": "GRASP_TYPE",
    "excluded_grasp_types": "GRASP_TYPE",
}
ANSWERED = [*PREFIXES.values(), "PHALANX", "OUTCOME", "REJECTION", "GRASP_SOURCE", "LIMIT_KIND", "STEP", "ATLAS_GROWTH"]


def to_message(value, key=None):
    """A request as protobuf's JSON. What is None is left out."""
    if isinstance(value, dict):
        named = {name: entry for name, entry in value.items() if entry is not None}
        return {
            name.removesuffix("_seconds"): f"{entry}s" if name.endswith("_seconds") else to_message(entry, name)
            for name, entry in named.items()
        }
    if key in VECTORS:
        return dict(zip("xyzw", map(float, value)))
    if isinstance(value, (list, tuple)):
        return [to_message(entry, key) for entry in value]
    if key in PREFIXES:
        return f"{PREFIXES[key]}_{value.upper()}"
    return value


def from_message(value):
    """Protobuf's JSON in the plainer form."""
    if isinstance(value, dict):
        if value and set(value) <= set("xyzw"):
            return [value.get(axis, 0.0) for axis in ("xyzw" if "w" in value else "xyz")]
        return dict(_entry(key, entry) for key, entry in value.items())
    if isinstance(value, list):
        return [from_message(entry) for entry in value]
    if isinstance(value, str) and re.fullmatch("[A-Z0-9_]+", value):
        starts = [prefix for prefix in ANSWERED if value.startswith(f"{prefix}_")]
        return value.removeprefix(f"{max(starts, key=len)}_").lower() if starts else value
    return value


def _entry(key, value):
    name = re.sub("(?<=[a-z0-9])(?=[A-Z])", "_", key).lower()
    if isinstance(value, str) and re.fullmatch(r"\d+(\.\d+)?s", value):
        return f"{name}_seconds", float(value[:-1])
    return name, from_message(value)
