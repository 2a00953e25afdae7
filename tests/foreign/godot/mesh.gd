class_name GraspMeshes
## Distances to meshes, as they are drawn.


## All triangles below a node, in the node's frame: three points each.
static func triangles(node: Node3D) -> PackedVector3Array:
	var faces := PackedVector3Array()
	for shown: MeshInstance3D in node.find_children("*", "MeshInstance3D", true, false):
		var node_from_mesh := Transform3D.IDENTITY
		var parent: Node = shown
		while parent != node:
			node_from_mesh = (parent as Node3D).transform * node_from_mesh
			parent = parent.get_parent()
		for point in shown.mesh.get_faces():
			faces.append(node_from_mesh * point)
	return faces


## The triangles of a posed hand in the skeleton's frame, deformed as its skin says.
static func posed_triangles(skeleton: Skeleton3D) -> PackedVector3Array:
	var shown: MeshInstance3D = skeleton.find_children("*", "MeshInstance3D", true, false)[0]
	var motions: Array[Transform3D] = []
	for bind in shown.skin.get_bind_count():
		var bone := shown.skin.get_bind_bone(bind)
		if bone < 0:
			bone = skeleton.find_bone(shown.skin.get_bind_name(bind))
		motions.append(skeleton.get_bone_global_pose(bone) * shown.skin.get_bind_pose(bind))
	var arrays := shown.mesh.surface_get_arrays(0)
	var vertices: PackedVector3Array = arrays[Mesh.ARRAY_VERTEX]
	var bones: PackedInt32Array = arrays[Mesh.ARRAY_BONES]
	var weights: PackedFloat32Array = arrays[Mesh.ARRAY_WEIGHTS]
	var per_vertex := bones.size() / vertices.size()
	var posed := PackedVector3Array()
	for vertex in vertices.size():
		var point := Vector3.ZERO
		for influence in range(vertex * per_vertex, (vertex + 1) * per_vertex):
			if weights[influence] > 0.0:
				point += motions[bones[influence]] * vertices[vertex] * weights[influence]
		posed.append(point)
	var faces := PackedVector3Array()
	for index: int in arrays[Mesh.ARRAY_INDEX]:
		faces.append(posed[index])
	return faces


## The distance of a point from the nearest triangle.
static func distance(point: Vector3, faces: PackedVector3Array) -> float:
	var least := INF
	for first in range(0, faces.size(), 3):
		least = minf(least, _distance_to_triangle(point, faces[first], faces[first + 1], faces[first + 2]))
	return least


static func _distance_to_triangle(point: Vector3, a: Vector3, b: Vector3, c: Vector3) -> float:
	var normal := (b - a).cross(c - a)
	var is_above := true
	var least := INF
	for edge: Array in [[a, b], [b, c], [c, a]]:
		least = minf(least, point.distance_to(Geometry3D.get_closest_point_to_segment(point, edge[0], edge[1])))
		is_above = is_above and (edge[1] - edge[0]).cross(point - edge[0]).dot(normal) >= 0.0
	return absf((point - a).dot(normal.normalized())) if is_above and normal != Vector3.ZERO else least
