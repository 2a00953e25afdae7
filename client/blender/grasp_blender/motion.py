"""Keys of what a grasp moves, in new actions."""


class Keys:
    """Keys that are added to objects and bones. What an object's action was before is kept in the file."""

    def __init__(self):
        self._owners = []
        self._rotations = {}

    def add(self, moved, frame):
        """Keys places and rotations of objects and bones of armatures."""
        for item in moved:
            self._own(item.id_data)
            item.rotation_mode = "QUATERNION"
            # Of the two quaternions of a rotation, the one that is reached the short way from the key before.
            key = (item.id_data, item.name)
            if item.rotation_quaternion.dot(self._rotations.get(key, item.rotation_quaternion)) < 0:
                item.rotation_quaternion.negate()
            self._rotations[key] = item.rotation_quaternion.copy()
            for path in ("location", "rotation_quaternion"):
                item.keyframe_insert(path, frame=frame, group=item.name)

    def add_shown(self, armature, shown, frame):
        """Keys whether the skin of an armature is shown."""
        for item in armature.children:
            self._own(item)
            item.hide_viewport = item.hide_render = not shown
            for path in ("hide_viewport", "hide_render"):
                item.keyframe_insert(path, frame=frame)

    def make_linear(self):
        """Makes everything move straight from key to key, which is the way that was found to be free."""
        for owner in self._owners:
            for curve in curves(owner):
                for point in curve.keyframe_points:
                    point.interpolation = "LINEAR"

    def _own(self, owner):
        if owner in self._owners:
            return
        self._owners.append(owner)
        if owner.animation_data is not None and (action := owner.animation_data.action) is not None:
            action.use_fake_user = True
            owner.animation_data.action = None


def curves(owner):
    """The F-curves of an object's action."""
    action = owner.animation_data.action
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    strips = (strip for layer in action.layers for strip in layer.strips)
    return [curve for strip in strips for bag in strip.channelbags for curve in bag.fcurves]
