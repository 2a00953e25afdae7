// Builds the page: one HTML file with code, style, hands and built-in holdouts inside, compressed.
//
//   node build.mjs            writes dist/index.html.gz
//   node build.mjs --check    exits with 1 if that file is not what the sources give
//
// Packages come from node_modules of this folder or of the folder that NODE_PATH names, the contract's code from buf.
import { createHash } from "node:crypto";
import { spawnSync } from "node:child_process";
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { gunzipSync, gzipSync } from "node:zlib";

const here = import.meta.dirname;
const root = path.resolve(here, "../../..");
const packages = (process.env.NODE_PATH ?? path.join(here, "node_modules")).split(path.delimiter)[0];
const page = path.join(here, "dist/index.html.gz");
const contract = path.join(here, "gen");

const { build } = createRequire(path.join(packages, "none.js"))("esbuild");

const bin = path.join(packages, ".bin");
const plugin = { local: path.join(bin, "protoc-gen-es"), out: contract, opt: ["target=ts"] };
const generated = spawnSync(path.join(bin, "buf"), ["generate", "--template", JSON.stringify({ version: "v2", plugins: [plugin] })], {
  cwd: path.join(root, "proto"),
  stdio: "inherit",
});
if (generated.status !== 0) process.exit(1);

const holdouts = readdirSync(path.join(root, "assets/holdouts"))
  .sort()
  .map((name) => JSON.parse(readFileSync(path.join(root, "assets/holdouts", name), "utf8")));
const builtIn = {
  name: "built-in",
  setup(all) {
    all.onResolve({ filter: /^#holdouts$/ }, () => ({ path: "holdouts", namespace: "built-in" }));
    all.onLoad({ filter: /.*/, namespace: "built-in" }, () => ({ contents: JSON.stringify(holdouts), loader: "json" }));
  },
};
const bundled = async (entry) => {
  const result = await build({
    entryPoints: [path.join(here, entry)],
    bundle: true,
    write: false,
    minify: true,
    format: "iife",
    target: "es2022",
    charset: "utf8",
    legalComments: "none",
    logLevel: "warning",
    alias: { "#contract": path.join(contract, "grasp/v1"), "#hands": path.join(root, "assets/hands") },
    loader: { ".glb": "binary" },
    nodePaths: [packages],
    plugins: [builtIn],
  });
  return result.outputFiles[0].text.trim();
};

const script = (await bundled("src/main.ts")).replaceAll("</script", "<\\/script");
const style = await bundled("src/style.css");
const hash = createHash("sha256").update(script).digest("base64");
const html = readFileSync(path.join(here, "src/index.html"), "utf8")
  .replace("SCRIPT_HASH", () => hash)
  .replace("/* style */", () => style)
  .replace("/* script */", () => script);

if (process.argv.includes("--check")) {
  const committed = gunzipSync(readFileSync(page)).toString();
  if (committed !== html) {
    console.error("client/web/viewer/dist/index.html.gz is stale: run npm run build in client/web/viewer and commit it");
    process.exit(1);
  }
} else {
  mkdirSync(path.dirname(page), { recursive: true });
  const packed = gzipSync(html, { level: 9 });
  writeFileSync(page, packed);
  console.log(`${(packed.length / 1e6).toFixed(2)} MB`);
}
