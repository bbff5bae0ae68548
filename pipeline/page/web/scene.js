// Brings the field of the page onto the graphics processor: unpacked by a worker, so that the page answers meanwhile.

function textOf(id) {
  const element = document.getElementById(id);
  if (!element) throw new PageError('a part of the page is missing: ' + id);
  return element.textContent;
}

const bytesOf = (id) => inflated(textOf(id), id);

// Of a field whose sections' names begin with `prefix`: see decodeField. Of splats the prefix "coarse_" names the first ones,
// which are a part of all.
async function decodedField(header, prefix, inWorker, progress) {
  const {resolution, basis, voxels, color, splats, center, radius} = header;
  const residuals = header.styles?.some((s) => s.residual) ?? false;
  const parts = !splats ? null : prefix ? [prefix] : ['coarse_', ''], texts = (name) => parts.map((part) => textOf(part + name));
  const text = splats ? {shape: texts('shape'), color: texts('color')}
      : {places: textOf(prefix + 'mask'), density: textOf(prefix + 'density'), color: textOf(prefix + 'color')};
  const task = {header: {resolution, basis, voxels, color, splats, center, radius, residuals}, text};
  const made = inWorker && await decodedByWorker(task, progress);
  if (made) return made;
  let waited = performance.now();  // browsers make timers that follow each other last for milliseconds
  return decodeField(task.header, text, async (part) => {
    progress(part);
    if (performance.now() - waited < 15) return;
    await wait();
    waited = performance.now();
  });
}

let workersRun = typeof Worker !== 'undefined';

// Null where workers cannot be started, as in some browsers from file://.
async function decodedByWorker(task, progress) {
  if (!workersRun) return null;
  const url = URL.createObjectURL(new Blob(["'use strict';(" + decoder + ')().serveDecoder()'], {type: 'text/javascript'}));
  let worker = null;
  try {
    worker = new Worker(url);
    return await new Promise((done, fail) => {
      worker.onerror = (event) => {
        event.preventDefault();
        workersRun = false;
        done(null);
      };
      worker.onmessage = ({data: {part, made, error, known}}) => {
        if (made) done(made);
        else if (error) fail(known ? new PageError(error) : new Error(error));
        else progress(part);
      };
      worker.postMessage(task);
    });
  } catch (error) {
    if (worker) throw error;
    workersRun = false;
    return null;
  } finally {
    worker?.terminate();
    URL.revokeObjectURL(url);
  }
}

// What only networks need waits outside the script's memory.
const asWords = async (blob) => new Uint32Array(await blob.arrayBuffer());
const asNumbers = async (blob) => new Int32Array(await blob.arrayBuffer());

function sceneOf(header, made, graphics) {
  if (header.splats) return new SplatScene(header, made, graphics);
  const {top, finest, voxels, slots, positionUnit, shift} = made;
  const scene = {header, top, finest, voxels, slots, positionUnit, shift};
  scene.unit = Math.max(...[0, 1, 2].map((a) => 2 * header.radius[a] / header.resolution[a]));
  for (const [name, kind] of [['tree', 'u4'], ['corner', 'u4'], ['base', 'i1'], ['color', 'u4']]) {
    scene[name] = graphics.texture(kind, made[name]);
    made[name] = null;  // whoever made it may keep it for long
  }
  scene.source = {color: scene.color, code: header.color, texelScale: [1, 1, 1], background: header.background};
  scene.kept = {};
  for (const name of ['place', 'voxel', 'earlier']) {
    scene.kept[name] = new Blob([made[name]]);
    made[name] = null;
  }
  scene.parts = [scene.tree, scene.corner, scene.base, scene.color];
  scene.free = () => scene.parts.forEach((texture) => graphics.free(texture));
  return scene;
}

// A small field that stands for the whole one until that is there; null if the page has none.
async function loadCoarse(header, graphics) {
  const coarse = header.splats?.coarse > 0 ? header : header.coarse;
  if (!coarse) return null;
  if (header.splats) SplatScene.warm(header, graphics, [0, 1].includes(header.styles[0]?.strength ?? 0) ? 1 : 2);
  const made = await decodedField(coarse, 'coarse_', false, () => {});
  return Object.assign(sceneOf({...coarse, ndc: header.ndc, spheres: null}, made, graphics), {coarse: true});
}

// `made`: by decodedField.
async function loadScene(header, made, graphics) {
  const scene = sceneOf(header, made, graphics);
  if (header.spheres) await loadSpheres(scene, graphics);
  return scene;
}

async function loadSpheres(scene, graphics) {
  const {layers, resolution} = scene.header.spheres, header = scene.header.sphere_color;
  const spheres = placesOfSpheres(await bytesOf('sphere_mask'), resolution, layers);
  const number = await unpackDensity(textOf('sphere_density'), 'sphere_density', spheres.earlier), n = number.length;
  const texel = new Uint32Array(2 * n), channel = new Int16Array(n), sum = new Float64Array(3 * n);
  for (let i = 0; i < n; ++i) texel[2 * i + 1] = toHalf(Math.sign(number[i]) * number[i] ** 2 * OPTICAL_DEPTH * layers);
  await eachChannel(textOf('sphere_color'), 'sphere_color', n, 3, (k, bytes) => {
    channelNumbers(bytes, spheres.earlier, channel);
    for (let i = 0; i < 3 * n; ++i) sum[i] += header.matrix[3 * k + i % 3] * channel[Math.floor(i / 3)] * header.step;
  });
  for (let i = 0; i < 3 * n; ++i) {
    const code = Math.max(-127, Math.min(127, Math.fround(sum[i]) / header.scale[i % 3])) + 128.5;
    texel[2 * Math.floor(i / 3)] |= code << 8 * (i % 3);  // rounded down
  }
  scene.column = graphics.texture('i1', spheres.links);
  scene.placeOfColumn = graphics.texture('i1', spheres.place);
  scene.parts.push(scene.column, scene.placeOfColumn);
  scene.source.texel = graphics.texture('u2', texel);
  scene.source.texelScale = header.scale;
}
