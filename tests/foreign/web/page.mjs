// Makes all calls from a page, and posts the results to the page's own server.

import { allCalls } from "./calls.mjs";

const { server, forbidding } = Object.fromEntries(new URLSearchParams(location.search));
let result;
try {
  result = await allCalls(server, forbidding);
} catch (error) {
  result = { failed: `${error}\n${error.stack}` };
}
await fetch("/result", { method: "POST", body: JSON.stringify(result) });
