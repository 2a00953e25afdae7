extends GraspCase
## Key frames are played from the first to the grasp without jumps, on an object that moves; then the hand glides to another grasp.

const SECONDS := 0.3
const STEP := 0.02

var player := GraspPlayer.new()
var arrivals := 0


func run() -> void:
	var request := {
		"holdout": {"object": "objects/remote"},
		"receiver": {"handedness": "HANDEDNESS_LEFT"},
		"output": {"keyFrames": true},
		"search": {"seed": 1, "choice": "GRASP_CHOICE_REPRODUCIBLE", "budget": "5s"},
	}
	var grasp := (await client.find_grasp(request)).grasp
	request.search.seed = 2
	request.requirements = {"excludedGraspTypes": ["GRASP_TYPE_" + grasp.type]}
	var other := (await client.find_grasp(request)).grasp
	expect(grasp.key_frames.size() == 3 and other.type != grasp.type, "key frames, and another grasp")
	player.object = Node3D.new()
	player.skeleton = load_hand("adult_left")
	player.tracker = XRHandTracker.new()
	player.arrived.connect(func() -> void: arrivals += 1)
	root.add_child(player.object)
	root.add_child(player)

	player.play(grasp, SECONDS)
	watch(grasp.key_frames[0], grasp.hand, "key frames")
	player.move_to(other.hand, SECONDS)
	watch(grasp.hand, other.hand, "to another grasp")
	expect(arrivals == 2, "arrived")


## Compares each frame with the one before, until the hand is there.
func watch(from: GraspHand, to: GraspHand, of: String) -> void:
	var largest := 0.0
	var stretched := 0.0
	var last := from.object_from_wrist.origin
	var before := arrivals
	while arrivals == before:
		player.object.position.x += 0.001
		player._process(STEP)
		var wrist := player.hand.object_from_wrist.origin
		largest = maxf(largest, wrist.distance_to(last))
		last = wrist
		for joint: int in [8, 9, 13, 14, 18, 19, 23, 24]:
			var parent := GraspHand.PARENTS[joint]
			var bone := player.hand.joints[joint].origin.distance_to(player.hand.joints[parent].origin)
			stretched = maxf(stretched, absf(bone - to.joints[joint].origin.distance_to(to.joints[parent].origin)))
	expect_within(1e-5, stretched, of + ": change of bones' lengths, m")
	expect_within(0.02, largest, of + ": longest step of the wrist, m")
	var there := to.at_object(player.object.global_transform)
	var bone := player.skeleton.find_bone("index-finger-tip")
	var tip := player.skeleton.global_transform * player.skeleton.get_bone_global_pose(bone).origin
	var tracked := player.tracker.get_hand_joint_transform(XRHandTracker.HAND_JOINT_INDEX_FINGER_TIP).origin
	expect_within(1e-5, tip.distance_to(there.joints[XRHandTracker.HAND_JOINT_INDEX_FINGER_TIP].origin), of + ": tip on the moving object, m")
	expect_within(1e-5, tracked.distance_to(tip), of + ": tracker to skeleton, m")
