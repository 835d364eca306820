// Holds GLB files against the Khronos validator and shows them with three.js in headless Chromium. Not run by CI.
//
//   npm install three gltf-validator playwright-core && apt-get install chromium
//   node scripts/check_gltf.mjs room.glb                                          what the validator says
//   node scripts/check_gltf.mjs room.glb --shot room.png --size 480x270           and a picture, lit by its own lights
//   reprobe view frames/0000.exr --layer diffuse -o diffuse.png
//   node scripts/check_gltf.mjs room.glb --shot light.png --lightmap --against diffuse.png
//
// --lightmap shows what the light map lights and nothing else, as the diffuse layer of a frame does; --against says how far display
// values are from another picture's. The camera is the file's first, or --look x,y,z,x,y,z,fov_x (from, to, degrees).
// Node looks for the packages from this folder upwards; CHROMIUM names another browser.
import { chromium } from "playwright-core";
import validator from "gltf-validator";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { readFile, writeFile } from "node:fs/promises";
import { basename, dirname, join, resolve } from "node:path";

const files = [], options = { size: "480x270" };
for (let words = process.argv.slice(2); words.length;) {
  const word = words.shift();
  if (word === "--lightmap") options.lightmap = true;
  else if (word.startsWith("--")) options[word.slice(2)] = words.shift();
  else files.push(word);
}
const [width, height] = options.size.split("x").map(Number);
const three = dirname(dirname(createRequire(import.meta.url).resolve("three")));
const PAGE = `<!doctype html><body style="margin:0"><script type="importmap">{"imports":{"three":"/three/build/three.module.js"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "/three/examples/jsm/loaders/GLTFLoader.js";
const { width, height, lightmap, look } = OPTIONS, SUPERSAMPLE = 4;
const chunk = THREE.ShaderChunk.lights_fragment_maps, plain = "lightMapTexel.rgb * lightMapIntensity";
if (!chunk.includes(plain)) throw new Error("three.js decodes light maps in another way than this script knows");
THREE.ShaderChunk.lights_fragment_maps = chunk.replace(plain, "34.49 * pow(lightMapTexel.a, 2.2) * " + plain);
const renderer = new THREE.WebGLRenderer(), wide = width * SUPERSAMPLE, high = height * SUPERSAMPLE;
const target = new THREE.WebGLRenderTarget(wide, high, { type: THREE.FloatType });
const loader = new GLTFLoader(), gltf = await loader.loadAsync("/scene.glb"), scene = gltf.scene, lights = [];
for (const object of [...scene.children, ...scene.getObjectsByProperty("isMesh", true), ...scene.getObjectsByProperty("isLight", true)]) {
  if (object.isLight) lights.push(object);
  const extension = object.userData.gltfExtensions?.MX_lightmap;
  for (const mesh of extension || lightmap ? object.getObjectsByProperty("isMesh", true) : []) {
    const material = mesh.material = mesh.material.clone();
    if (lightmap) { material.emissive?.set(0); material.emissiveMap = null; }
    material.aoMap = null;
    if (material.map) Object.assign(material.map, { minFilter: material.map.magFilter, generateMipmaps: false, needsUpdate: true });
    if (!extension) continue;
    material.lightMap = (await gltf.parser.getDependency("texture", extension.lightMapTexture.index)).clone();
    Object.assign(material.lightMap, { channel: 1, colorSpace: THREE.NoColorSpace, generateMipmaps: false, minFilter: THREE.LinearFilter, needsUpdate: true });
    material.lightMapIntensity = extension.intensity;
  }
}
if (lightmap) lights.forEach(light => light.removeFromParent());
scene.updateMatrixWorld(true);
let camera = gltf.cameras[0];
if (look) {
  const aspect = width / height, fov = 2 * Math.atan(Math.tan(look[6] * Math.PI / 360) / aspect) * 180 / Math.PI;
  camera = new THREE.PerspectiveCamera(fov, aspect, .01, 1000);
  camera.position.set(...look.slice(0, 3)); camera.lookAt(...look.slice(3, 6)); camera.updateMatrixWorld();
}
renderer.setRenderTarget(target);
renderer.render(scene, camera);
// The mean of each pixel's samples in linear light, clamped last, as our frames have it. Rows come from the bottom.
const fine = new Float32Array(4 * wide * high), coarse = new ImageData(width, height);
renderer.readRenderTargetPixels(target, 0, 0, wide, high, fine);
for (let i = 0; i < width * height * 4; i++) {
  const x = (i >> 2) % width * SUPERSAMPLE, y = (height - 1 - Math.floor((i >> 2) / width)) * SUPERSAMPLE;
  let mean = 0;
  for (let k = 0; k < SUPERSAMPLE ** 2; k++) mean += fine[((y + Math.floor(k / SUPERSAMPLE)) * wide + x + k % SUPERSAMPLE) * 4 + (i & 3)] / SUPERSAMPLE ** 2;
  mean = Math.min(mean, 1);
  coarse.data[i] = (i & 3) === 3 ? 255 : Math.round(255 * (mean <= .0031308 ? 12.92 * mean : 1.055 * mean ** (1 / 2.4) - .055));
}
const picture = Object.assign(document.createElement("canvas"), { width, height });
picture.getContext("2d").putImageData(coarse, 0, 0);
window.picture = picture.toDataURL("image/png");
window.shown = { calls: renderer.info.render.calls, triangles: renderer.info.render.triangles };
</script>`;

const browser = options.shot && await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"] });
let failed = 0;
for (const file of files) {
  const bytes = new Uint8Array(await readFile(file));
  const report = await validator.validateBytes(bytes, { uri: basename(file), maxIssues: 1000,
    externalResourceFunction: uri => readFile(resolve(dirname(file), decodeURIComponent(uri))).then(b => new Uint8Array(b)) });
  const { numErrors, numWarnings, messages } = report.issues;
  failed += numErrors;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings`);
  const kinds = new Map();
  for (const m of messages.filter(m => m.severity < 2)) kinds.set(m.code, [...(kinds.get(m.code) ?? []), `${m.pointer}: ${m.message}`]);
  for (const [code, list] of kinds) console.log(`  ${code} (${list.length}): ${list[0]}`);
  if (!browser) continue;
  const look = options.look?.split(",").map(Number);
  const page = await browser.newPage({ viewport: { width, height } });
  const server = createServer(async (request, response) => {
    const path = decodeURIComponent(new URL(request.url, "http://x").pathname);
    const types = { js: "text/javascript", html: "text/html" }, type = types[path.split(".").pop()] ?? "application/octet-stream";
    const content = path === "/page.html" ? PAGE.replace("OPTIONS", JSON.stringify({ width, height, lightmap: !!options.lightmap, look }))
      : await readFile(path === "/scene.glb" ? file : path.startsWith("/three/") ? join(three, path.slice(7)) : "").catch(() => null);
    response.writeHead(content === null ? 404 : 200, { "content-type": type }).end(content ?? "");
  });
  await new Promise(done => server.listen(0, "127.0.0.1", done));
  page.on("pageerror", e => { failed++; console.log(`  page: ${e.message}`); });
  await page.goto(`http://127.0.0.1:${server.address().port}/page.html`);
  await page.waitForFunction("window.shown", null, { timeout: 120000 });
  console.log("  three.js:", JSON.stringify(await page.evaluate("window.shown")));
  await writeFile(options.shot, Buffer.from((await page.evaluate("window.picture")).split(",")[1], "base64"));
  if (options.against) {
    const data = async path => `data:image/png;base64,${(await readFile(path)).toString("base64")}`;
    const rmse = await page.evaluate(async urls => {
      const [a, b] = await Promise.all(urls.map(async url => {
        const image = new Image(); image.src = url; await image.decode();
        const canvas = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
        const context = canvas.getContext("2d"); context.drawImage(image, 0, 0);
        return context.getImageData(0, 0, image.width, image.height).data;
      }));
      if (a.length !== b.length) throw new Error("the pictures differ in size");
      let sum = 0, count = 0;
      for (let i = 0; i < a.length; i++) if (i % 4 < 3) { sum += ((a[i] - b[i]) / 255) ** 2; count++; }
      return Math.sqrt(sum / count);
    }, [await data(options.shot), await data(options.against)]);
    console.log(`  RMSE to ${options.against}: ${rmse.toFixed(4)}`);
  }
  await page.close(); server.close();
}
await browser?.close();
process.exit(failed ? 1 : 0);
