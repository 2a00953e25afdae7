class_name GraspAnswer
extends GraspReply
## The answer to [method GraspClient.find_grasp]. No grasp in time is an answer, not an error: [member grasp] is null then, and
## [member report] says how far the search came.

## The grasp; null without one.
var grasp: Grasp:
	get:
		return grasps[0] if grasps else null
## The left and the right hand's, of a request for both hands, or that one grasp.
var grasps: Array[Grasp] = []
## "FOUND", "BUDGET_EXHAUSTED" or "ABORTED"; empty before the end of a stream.
var outcome := ""
## The search's report, as JSON.
var report: Dictionary = {}


## Reads the contract's [code]FindGraspResponse[/code].
static func from_reply(reply: GraspReply) -> GraspAnswer:
	var answer := GraspAnswer.new()
	answer.error = reply.error
	answer.message = reply.message
	answer.outcome = reply.message.get("outcome", "").trim_prefix("OUTCOME_")
	answer.report = reply.message.get("report", {})
	for sent: Dictionary in reply.message.get("grasps", []):
		answer.grasps.append(Grasp.from_json(sent))
	return answer
