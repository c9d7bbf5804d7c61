/* Renders models with three.js in headless Chromium, from 12 directions, lit by two lights; one PNG a view.
   node look.cjs CHROMIUM PIXELS FOLDER MODEL... ; models are .glb, .obj (with .mtl) or .ply (with TextureFile).
   Prints one line of JSON: for each model {draws, materials, programs}. Needs three and playwright-core. */

const http = require("http"), fs = require("fs"), path = require("path");
const { chromium } = require("playwright-core");
const [executablePath, pixels, folder, ...models] = process.argv.slice(2);
const three = path.dirname(path.dirname(require.resolve("three")));
const kinds = { ".js": "text/javascript", ".html": "text/html", ".png": "image/png", ".jpg": "image/jpeg", ".webp": "image/webp" };

const page = `<!doctype html><script type="importmap">{"imports": {"three": "/three/build/three.module.js",
  "three/addons/": "/three/examples/jsm/"}}</script><script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { MTLLoader } from "three/addons/loaders/MTLLoader.js";
import { PLYLoader } from "three/addons/loaders/PLYLoader.js";

async function load(url) {
  const base = url.slice(0, url.lastIndexOf("/") + 1), kind = url.slice(url.lastIndexOf("."));
  if (kind === ".obj") {
    const text = await (await fetch(url)).text(), library = /^mtllib\\s+(.+?)\\s*$/m.exec(text);
    const loader = new OBJLoader();
    if (library) {
      const found = await new MTLLoader().setResourcePath(base).loadAsync(base + encodeURIComponent(library[1]));
      found.preload();
      loader.setMaterials(found);
    }
    return loader.parse(text);
  }
  if (kind === ".ply") {
    const data = await (await fetch(url)).arrayBuffer();
    const name = /comment\\s+TextureFile\\s+(.+)/i.exec(new TextDecoder("latin1").decode(data.slice(0, 4096)));
    const geometry = new PLYLoader().parse(data);
    if (!geometry.attributes.normal) geometry.computeVertexNormals();
    const map = name && await new THREE.TextureLoader().loadAsync(base + encodeURIComponent(name[1].trim()));
    if (map) map.colorSpace = THREE.SRGBColorSpace, map.wrapS = map.wrapT = THREE.RepeatWrapping;
    return new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ map, roughness: 0.9 }));
  }
  return (await new GLTFLoader().loadAsync(url)).scene;
}

window.shoot = async (url, size, views) => {
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setSize(size, size);
  renderer.toneMapping = THREE.NoToneMapping;
  const waiting = THREE.DefaultLoadingManager, loaded = new Promise((done) => (waiting.onLoad = done));
  const model = await load(url);
  await Promise.race([loaded, new Promise((done) => setTimeout(done, 1500))]);
  const scene = new THREE.Scene(), materials = new Set();
  scene.background = new THREE.Color(0x808080);
  scene.add(model);
  model.traverse((o) => o.isMesh && [o.material].flat().forEach((m) => {
    materials.add(m.uuid);
    for (const t of Object.values(m)) if (t && t.isTexture) t.anisotropy = renderer.capabilities.getMaxAnisotropy();
  }));
  model.updateMatrixWorld(true);
  const box = new THREE.Box3().setFromObject(model), ball = box.getBoundingSphere(new THREE.Sphere());
  const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 10);
  const scale = ball.radius;
  Object.assign(camera, { left: -scale, right: scale, top: scale, bottom: -scale, near: 0, far: 4 * scale });
  camera.updateProjectionMatrix();
  const sun = new THREE.DirectionalLight(0xffffff, 2.5), sky = new THREE.HemisphereLight(0xffffff, 0x888888, 1.5);
  scene.add(sun, sky, sun.target);
  const shots = [];
  for (const [x, y, z] of views) {
    const from = new THREE.Vector3(x, y, z).normalize();
    camera.position.copy(ball.center).addScaledVector(from, 2 * scale);
    camera.up.set(0, 1, 0);
    camera.lookAt(ball.center);
    sun.target.position.copy(ball.center);
    sun.position.copy(ball.center).addScaledVector(from, scale).add(new THREE.Vector3(scale, 2 * scale, 0.5 * scale));
    renderer.render(scene, camera);
    shots.push(renderer.domElement.toDataURL("image/png"));
  }
  const out = { draws: renderer.info.render.calls, materials: materials.size, shots };
  renderer.dispose();
  renderer.forceContextLoss();
  return out;
};
window.ready = true;
</script>`;

/* The corners of an icosahedron: 12 directions spread evenly over the sphere. */
const g = (1 + Math.sqrt(5)) / 2;
const views = [-1, 1].flatMap((a) => [-g, g].flatMap((b) => [[0, a, b], [a, b, 0], [b, 0, a]]));

(async () => {
  const server = http.createServer((request, reply) => {
    const name = decodeURIComponent(request.url.split("?")[0]);
    const send = (file) => fs.readFile(file, (error, data) => {
      reply.writeHead(error ? 404 : 200, { "content-type": kinds[path.extname(file)] ?? "application/octet-stream" });
      reply.end(data);
    });
    const model = /^\/model\/(\d+)\/(.*)$/.exec(name);
    if (name === "/") reply.setHeader("content-type", "text/html"), reply.end(page);
    else if (name.startsWith("/three/")) send(path.join(three, name.slice(7)));
    else if (model) send(path.join(path.dirname(models[model[1]]), model[2]));
    else reply.writeHead(404).end();
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  const browser = await chromium.launch({ executablePath, headless: true, args: ["--no-sandbox",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync"] });
  const out = {};
  try {
    const tab = await browser.newPage();
    tab.on("console", (m) => m.type() === "error" && process.stderr.write(m.text() + "\n"));
    tab.on("pageerror", (e) => process.stderr.write(e + "\n"));
    await tab.goto(`http://127.0.0.1:${server.address().port}/`);
    await tab.waitForFunction("window.ready");
    for (const [k, model] of models.entries()) {
      const url = `/model/${k}/` + encodeURIComponent(path.basename(model));
      const { shots, ...rest } = await tab.evaluate(([u, s, v]) => window.shoot(u, s, v), [url, Number(pixels), views]);
      shots.forEach((s, i) => fs.writeFileSync(path.join(folder, `${k}_${i}.png`), Buffer.from(s.split(",")[1], "base64")));
      out[model] = rest;
    }
  } finally {
    await browser.close();
    server.close();
  }
  console.log(JSON.stringify(out));
})();
