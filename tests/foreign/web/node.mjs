// Makes all calls from Node and prints the results.

import { allCalls } from "./calls.mjs";

console.log(JSON.stringify(await allCalls(process.argv[2], null)));
