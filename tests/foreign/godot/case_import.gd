extends GraspCase
## Importers of Godot keep axes and lengths: contacts are on the surface of a file that the server read and Godot imported. In the project:
## tests/scissors.obj.

const METERS := 1e-4


func run() -> void:
	var obj := FileAccess.get_file_as_bytes(repository.path_join("assets/objects/scissors.obj"))
	var imported := MeshInstance3D.new()
	imported.mesh = load("res://tests/scissors.obj")
	var holder := Node3D.new()
	holder.add_child(imported)
	await check("objects/godot-obj", obj, holder, "OBJ")

	var glb := PackedByteArray()
	var append := func(message: Dictionary) -> void: glb.append_array(GraspJson.read_bytes(message.get("piece", "")))
	var error := await client.ask_stream("grasp.v1.ObjectService/GetMesh", {"name": "objects/remote"}, append)
	expect(error == null, "the file of a mesh: %s" % error)
	var state := GLTFState.new()
	var document := GLTFDocument.new()
	document.append_from_buffer(glb, "", state)
	await check("objects/godot-glb", glb, document.generate_scene(state), "GLB")
	await check_grasp("objects/remote", await client.get_mesh("objects/remote"), "of the service")
	expect(await client.get_mesh("objects/nowhere") == null, "no mesh of an unknown object")
	await check_pieces()


func check(name: String, file: PackedByteArray, imported: Node3D, kind: String) -> void:
	var request := {"object": {"name": name, "massKg": 0.1}, "mesh": Marshalls.raw_to_base64(file)}
	var created := await client.ask("grasp.v1.ObjectService/CreateObject", request)
	expect(created.error == null, "created: %s" % created.error)
	await check_grasp(name, imported, kind)
	await client.ask("grasp.v1.ObjectService/DeleteObject", {"name": name})


func check_grasp(name: String, imported: Node3D, kind: String) -> void:
	var faces := GraspMeshes.triangles(imported)
	var mirrored := PackedVector3Array(Array(faces).map(func(point: Vector3) -> Vector3: return point * Vector3(1, 1, -1)))
	var farthest := 0.0
	var farthest_mirrored := 0.0
	for handedness: String in ["HANDEDNESS_LEFT", "HANDEDNESS_RIGHT"]:
		var answer := await client.find_grasp({
			"holdout": {"object": name},
			"receiver": {"handedness": handedness},
			"search": {"seed": 1, "choice": "GRASP_CHOICE_REPRODUCIBLE", "ignoreAtlas": true, "budget": "20s"},
		})
		expect(answer.grasp != null, "%s, %s: %s" % [kind, handedness, answer.error])
		if answer.grasp:
			for contact in answer.grasp.contacts:
				farthest = maxf(farthest, GraspMeshes.distance(contact.position, faces))
				farthest_mirrored = maxf(farthest_mirrored, GraspMeshes.distance(contact.position, mirrored))
	expect_within(METERS, farthest, "%s: contacts to the imported mesh, m" % kind)
	print("%s: to its mirror image: %f" % [kind, farthest_mirrored])
	expect(farthest_mirrored > 10 * METERS, "a mesh with other axes would be noticed")
	imported.free()


## A mesh that the server sends in several messages.
func check_pieces() -> void:
	var ball := SphereMesh.new()
	ball.radius = 0.04
	ball.height = 0.08
	ball.radial_segments = 96
	ball.rings = 48
	var lines := PackedStringArray()
	for point in ball.get_faces():
		lines.append("v %f %f %f" % [point.x, point.y, point.z])
	for first in range(1, lines.size(), 3):
		# Faces of Godot are clockwise.
		lines.append("f %d %d %d" % [first, first + 2, first + 1])
	var name := "objects/godot-ball"
	var request := {"object": {"name": name, "massKg": 0.1}, "mesh": Marshalls.utf8_to_base64("\n".join(lines))}
	var created := await client.ask("grasp.v1.ObjectService/CreateObject", request)
	expect(created.error == null, "created: %s" % created.error)
	var sizes: Array[int] = []
	var append := func(message: Dictionary) -> void: sizes.append(GraspJson.read_bytes(message.piece).size())
	await client.ask_stream("grasp.v1.ObjectService/GetMesh", {"name": name}, append)
	print("pieces of a mesh: %s" % [sizes])
	expect(sizes.size() > 1, "a mesh in pieces")
	var mesh := await client.get_mesh(name)
	expect_within(1e-4, GraspMeshes.distance(Vector3(0, 0.04, 0), GraspMeshes.triangles(mesh)), "its pole, m")
	mesh.free()
	await client.ask("grasp.v1.ObjectService/DeleteObject", {"name": name})
