class_name GraspReply
extends RefCounted
## The end of a call: a message, or an error.

## Null if the call succeeded.
var error: GraspError
## The message as JSON.
var message: Dictionary = {}
