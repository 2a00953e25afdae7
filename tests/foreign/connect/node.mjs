// Makes all calls of a page over Connect, with a transport of JSON and one of protobuf, and prints the results.

import { createConnectTransport } from "@connectrpc/connect-web";
import { callsOver } from "../web/calls.mjs";

const baseUrl = process.argv[2];
const deadline = { "connect-timeout-ms": "0" };
console.log(
  JSON.stringify({
    json: await callsOver(createConnectTransport({ baseUrl }), deadline),
    proto: await callsOver(createConnectTransport({ baseUrl, useBinaryFormat: true }), deadline),
  }),
);
