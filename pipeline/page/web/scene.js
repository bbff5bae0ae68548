// Decodes the field of the page and puts it on the graphics processor.

async function loadScene(header, graphics, progress) {
  const {resolution, basis} = header, finestOfPage = header.finest, onCells = finestOfPage !== null;
  let places = null, vertices;
  progress(0.02, 'places');
  if (onCells) {
    places = placesOfTree(await bytesOf('tree'), resolution, finestOfPage, header.voxels);
    vertices = places.vertices;
  } else {
    vertices = placesOfMask(await bytesOf('mask'), resolution, header.voxels);
  }
  const n = vertices.count, {place} = vertices;
  if (n !== header.voxels) throw new PageError('the page has fewer voxels than it says');
  const earlier = vertices.earlier.subarray(0, 3 * n);
  progress(0.1, 'densities');
  await wait();
  const number = await unpackDensity('density', earlier);
  if (!onCells) places = cellsOfGrid(vertices, resolution, number);
  places = raisedTree(places);
  const rootOfWidth = Array.from({length: 32}, (_, log2) => 2 ** (-0.5 * log2));
  const root = (i) => i < n ? number[i] * rootOfWidth[vertices.width[i]] : 0;

  const scene = {header, top: places.top, finest: places.finest, cells: places.corner.length / 8, voxels: n};
  if (header.styles.some((style) => style.residual)) scene.earlier = earlier;
  scene.unit = Math.max(...[0, 1, 2].map((a) => 2 * header.radius[a] / resolution[a]));
  scene.tree = graphics.texture('u4', packedTree(places, root));
  scene.corner = graphics.texture('u4', new Uint32Array(places.corner.buffer));

  // A voxel: 27 codes, channel by channel, and its place in 39 bits; the last one is empty.
  const first = new Uint8Array(16 * (n + 1)).fill(128), second = new Uint8Array(16 * (n + 1)).fill(128);
  const channels = 3 * basis, slot = [];
  for (let j = 0; j < channels; ++j) slot.push(9 * Math.floor(j / basis) + j % basis);
  progress(0.2, 'colours');
  await unpackColors('color', header.color, channels, earlier, (begin, codes, count) => {
    for (let j = 0; j < channels; ++j) {
      const into = slot[j] < 16 ? first : second;
      for (let i = 0, at = 16 * begin + slot[j] % 16; i < count; ++i, at += 16) into[at] = codes[i * channels + j];
    }
  }, (part) => progress(0.2 + 0.7 * part, 'colours'));
  const words = new Uint32Array(second.buffer);
  let shift = 0;
  while (Math.max(...resolution) >> shift > 8191) ++shift;
  for (let i = 0; i < n; ++i) {
    const [x, y, z] = [place[3 * i] >> shift, place[3 * i + 1] >> shift, place[3 * i + 2] >> shift];
    second[16 * i + 11] = x & 255;
    words[4 * i + 3] = (x >> 8 | y << 5 | z << 18) >>> 0;
  }
  const scale = new Float32Array(27).fill(1);
  slot.forEach((k, j) => scale[k] = header.color.scale[j]);
  scene.positionUnit = resolution.map((r) => 2 * 2 ** shift / r);
  scene.source = {first: graphics.texture('u4', new Uint32Array(first.buffer)),
                  second: graphics.texture('u4', words), scale, texelScale: [1, 1, 1],
                  background: header.background};
  if (header.spheres) await loadSpheres(scene, graphics);
  progress(1, '');
  return scene;
}

async function loadSpheres(scene, graphics) {
  const {layers, resolution} = scene.header.spheres, header = scene.header.sphere_color;
  const spheres = placesOfSpheres(await bytesOf('sphere_mask'), resolution, layers);
  const number = await unpackDensity('sphere_density', spheres.earlier);
  const texel = new Uint32Array(2 * number.length);
  for (let i = 0; i < number.length; ++i)
    texel[2 * i + 1] = toHalf(Math.sign(number[i]) * number[i] ** 2 * OPTICAL_DEPTH * layers);
  await unpackColors('sphere_color', header, 3, spheres.earlier,
                     (begin, codes, count) => {
                       for (let i = 0; i < 3 * count; ++i) texel[2 * (begin + Math.floor(i / 3))] |= codes[i] << 8 * (i % 3);
                     }, () => {});
  scene.column = graphics.texture('i1', spheres.links);
  scene.placeOfColumn = graphics.texture('i1', spheres.place);
  scene.source.texel = graphics.texture('u2', texel);
  scene.source.texelScale = header.scale;
}
