class_name GraspUrl
extends RefCounted
## The address of a server, such as "http://[::1]:50051" or "https://grasp.example.com/behind/a/path".

## Without brackets.
var host := ""
var port := 0
## Host and port as a request names them.
var authority := ""
## Before the method's; mostly empty.
var path := ""
## Null of http.
var tls: TLSOptions


## Reads an address. The trust of https is that of [param options], by default the system's.
func _init(text: String, options: TLSOptions) -> void:
	var is_secure := text.begins_with("https://")
	tls = (options if options else TLSOptions.client()) if is_secure else null
	var rest := text.trim_prefix("https://").trim_prefix("http://").trim_suffix("/")
	authority = rest.get_slice("/", 0)
	path = rest.trim_prefix(authority)
	port = 443 if is_secure else 80
	host = authority
	var colon := authority.rfind(":")
	if colon > authority.rfind("]"):
		host = authority.left(colon)
		port = authority.substr(colon + 1).to_int()
	host = host.trim_prefix("[").trim_suffix("]")
	if host == "::1":
		# HTTPClient refuses hosts of fewer than four characters.
		host = "0:0:0:0:0:0:0:1"
