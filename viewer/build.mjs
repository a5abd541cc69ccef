// Builds src/stridor/view/templates/viewer.js, and puts three's licence beside it: npm ci && npm run build, or
// `make viewer`. Its first lines say what it was built from; tests/unit/test_viewer_bundle.py holds them against it.
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const SOURCES = ["build.mjs", "package-lock.json", "package.json", "src/viewer.js"];
const OUT = "../src/stridor/view/templates/";

process.chdir(import.meta.dirname);
const licence = readFileSync("node_modules/three/LICENSE", "utf-8").trim();
const digest = createHash("sha256");
for (const name of SOURCES) digest.update(readFileSync(name));
const { version } = JSON.parse(readFileSync("node_modules/three/package.json", "utf-8"));

// three's own materials are never used: their shaders, a third of it all, are left out.
const withoutShaders = {
  name: "without-shaders",
  setup(of) {
    of.onLoad({ filter: /three[\\/]src[\\/]renderers[\\/]shaders[\\/]Shader(Chunk|Lib)[\\/].*\.glsl\.js$/ }, () => ({
      contents: 'export default ""; export const vertex = "", fragment = "";',
    }));
  },
};
const made = await build({
  absWorkingDir: import.meta.dirname, entryPoints: ["src/viewer.js"], bundle: true, minify: true, format: "iife", target: "es2020", charset: "ascii",
  legalComments: "none", write: false, alias: { three: "three/src/Three.js" }, plugins: [withoutShaders],
});
const body = made.outputFiles[0].text;
const own = createHash("sha256").update(body).digest("hex");
// The licence goes wherever the file goes, into pages that are passed on as well.
const head = `/*! The viewer of stridor (MIT), on three.js ${version}. Built by \`make viewer\`, not to be changed by hand.
sources sha256-${digest.digest("hex")}
what follows sha256-${own}

three.js: ${licence.replace("©", "(c)")}
*/
`;
writeFileSync(`${OUT}viewer.js`, head + body);
writeFileSync(`${OUT}three-LICENSE.txt`, `${licence}\n`);
