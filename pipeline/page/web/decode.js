// The field of a page as the textures that hold it; runs in a worker, or where there are none in slices.

const BLOCK = 10;  // cells that share a base, logarithm; march.glsl's, too

// Cells' corners as 16-bit numbers of slots, from the base of their block on. A base is as far back as a block's new slots
// allow, at most 8 a cell; a voxel whose slot is farther back gets another one, so a few are there twice. `order`: of the
// cells in the tree; voxel `voxels` is the empty one.
// -> {corner: a texel a cell, base [blocks], voxel: of each slot}
function cornersOf(corner, order, voxels) {
  const cells = order.length, words = new Uint32Array(4 * cells), slot = new Int32Array(voxels + 1).fill(-1), base = [];
  let voxel = new Int32Array(voxels + (voxels >> 4) + 16), count = 0, begin = 0;
  for (let cell = 0, at = 0; cell < cells; ++cell) {
    if ((cell & (1 << BLOCK) - 1) === 0) base.push(begin = Math.max(0, count + (8 << BLOCK) - 65536));
    if (count + 8 > voxel.length) {
      const longer = new Int32Array(2 * count + 16);
      longer.set(voxel);
      voxel = longer;
    }
    for (let k = 0, from = 8 * order[cell]; k < 8; k += 2, ++at)
      for (let half = 0; half < 2; ++half) {
        const v = corner[from + k + half];
        if (slot[v] < begin) {
          voxel[count] = v;
          slot[v] = count++;
        }
        words[at] |= slot[v] - begin << 16 * half;
      }
  }
  return {corner: words, base: Int32Array.from(base), voxel: voxel.slice(0, count)};
}

// `text`: of the sections places, density and color. Calls progress(part).
async function decodeVoxels(header, text, progress) {
  const {resolution, basis} = header;
  checkCode(header.color, 'color');
  const bytes = await inflated(text.places, 'places');
  await progress(0.05);
  const vertices = new Vertices(bytes, resolution, header.voxels), n = vertices.count, {place} = vertices;
  if (n !== header.voxels) throw new PageError('the page has fewer voxels than it says');
  const earlier = vertices.earlier.subarray(0, 3 * n);
  await progress(0.35);
  const number = await unpackDensity(text.density, 'density', earlier);
  let places = cellsOfGrid(vertices, resolution, number);
  await progress(0.4);
  places = raisedTree(places);
  const {tree, order} = packedTree(places, (i) => i < n ? number[i] : 0);
  await progress(0.5);
  const {corner, base, voxel} = cornersOf(places.corner, order, n), slots = voxel.length;
  const made = {top: places.top, finest: places.finest, voxels: n, tree, corner, base, voxel};
  places = null;
  await progress(0.6);

  const color = made.color = new Uint32Array(4 * slots), channel = new Int16Array(n + 1), where = placesOfNumbers(header.color.bits);
  await eachChannel(text.color, 'color', n, 3 * basis, async (k, packed) => {
    channelNumbers(packed, earlier, channel.subarray(0, n));
    const {word, above, unused} = where[9 * Math.floor(k / basis) + k % basis];
    for (let s = 0, at = word; s < slots; ++s, at += 4) color[at] |= channel[voxel[s]] << unused >>> above;
    await progress(0.6 + 0.38 * (k + 1) / (3 * basis));
  });
  // Places in 16 bits, for networks; the empty voxel has the highest bit.
  made.place = new Uint32Array(2 * slots);
  let halvings = 0;
  while (Math.max(...resolution) >> halvings > 65535) ++halvings;
  for (let s = 0; s < slots; ++s) {
    const v = voxel[s];
    made.place[2 * s] = v === n ? 0 : place[3 * v] >> halvings | place[3 * v + 1] >> halvings << 16;
    made.place[2 * s + 1] = v === n ? 2 ** 31 : place[3 * v + 2] >> halvings;
  }
  made.positionUnit = resolution.map((r) => 2 * 2 ** halvings / r);
  made.slots = slots;
  made.shift = 0.5;
  made.earlier = header.residuals ? earlier.slice() : new Int32Array(0);
  return made;
}

const decodeField = (header, text, progress) => (header.splats ? decodeSplats : decodeVoxels)(header, text, progress);

// In a worker: a field for each message.
function serveDecoder() {
  onmessage = async ({data}) => {
    try {
      const made = await decodeField(data.header, data.text, (part) => postMessage({part}));
      postMessage({made}, Object.values(made).filter(ArrayBuffer.isView).map((list) => list.buffer));
    } catch (error) {
      postMessage({error: error.message, known: error instanceof PageError || error instanceof RangeError});
    }
  };
}
