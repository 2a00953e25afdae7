class_name GraspConnection
extends RefCounted
## A connection to the server, kept alive from one request to the next. [GraspClient] opens as many as it has requests in flight.

## Bytes of an answer that are read at once.
const _CHUNK_SIZE := 1 << 20

## The status of the HTTP answer; 0 if none came.
var status := 0
## True if the time was over before the answer was.
var is_late := false

var _http := HTTPClient.new()


func _init() -> void:
	_http.read_chunk_size = _CHUNK_SIZE


## Posts [param body], and calls [param received] with each piece of the answer as it comes. True if all of it came within
## [param timeout] seconds. A connection that the server closed meanwhile is opened again.
func post(url: GraspUrl, method: String, headers: PackedStringArray, body: PackedByteArray, timeout: float, received: Callable) -> bool:
	var end := Time.get_ticks_msec() + int(timeout * 1000)
	_http.poll()
	var was_open := _http.get_status() == HTTPClient.STATUS_CONNECTED
	var is_done := await _post_once(url, method, headers, body, end, received)
	if not is_done and was_open and status == 0 and not is_late:
		is_done = await _post_once(url, method, headers, body, end, received)
	if not is_done:
		_http.close()
	return is_done


func _post_once(url: GraspUrl, method: String, headers: PackedStringArray, body: PackedByteArray, end: int, received: Callable) -> bool:
	status = 0
	is_late = false
	if _http.get_status() != HTTPClient.STATUS_CONNECTED:
		_http.close()
		if _http.connect_to_host(url.host, url.port, url.tls) != OK:
			return false
		await _poll_while([HTTPClient.STATUS_RESOLVING, HTTPClient.STATUS_CONNECTING], end)
	if _http.get_status() != HTTPClient.STATUS_CONNECTED:
		return false
	_http.request_raw(HTTPClient.METHOD_POST, url.path + "/" + method, PackedStringArray(["Host: " + url.authority]) + headers, body)
	await _poll_while([HTTPClient.STATUS_REQUESTING], end)
	if not _http.has_response():
		return false
	status = _http.get_response_code()
	while _http.get_status() == HTTPClient.STATUS_BODY and not is_late:
		var piece := _http.read_response_body_chunk()
		if piece.is_empty():
			await _next_frame(end)
			_http.poll()
		else:
			received.call(piece)
	return _http.get_status() in [HTTPClient.STATUS_CONNECTED, HTTPClient.STATUS_DISCONNECTED] and not is_late


func _poll_while(waiting: Array[HTTPClient.Status], end: int) -> void:
	while _http.get_status() in waiting and not is_late:
		_http.poll()
		if _http.get_status() in waiting:
			await _next_frame(end)


func _next_frame(end: int) -> void:
	await (Engine.get_main_loop() as SceneTree).process_frame
	is_late = Time.get_ticks_msec() >= end
