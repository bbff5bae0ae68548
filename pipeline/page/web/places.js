// Places of voxels, and the tree in which a ray finds them; pipeline/page/page_order.h says how
// they are stored.

const cornerOf = (low, width, k) =>
    [low[0] + (k >> 2) * width, low[1] + (k >> 1 & 1) * width, low[2] + (k & 1) * width];

// Vertices by their places, numbered as they come.
class Vertices {
  constructor(most) {
    this.count = 0;
    this.most = most;
    this.place = new Int32Array(3 * most);
    this.earlier = new Int32Array(3 * most).fill(-1);
    this.width = new Uint8Array(most);  // logarithm of the widest cell around it
    let size = 16;
    while (size < 2 * most) size *= 2;
    this.slot = new Int32Array(size).fill(-1);
  }
  // The number of a place; a new one is added where `add` is set, else -1.
  find(x, y, z, add) {
    let at = (Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791));
    at = Math.imul(at ^ at >>> 15, 0x2c1b3c6d);
    const mask = this.slot.length - 1;
    const {slot, place} = this;
    for (at = (at ^ at >>> 13) & mask; slot[at] >= 0; at = at + 1 & mask) {
      const i = slot[at];
      if (place[3 * i] === x && place[3 * i + 1] === y && place[3 * i + 2] === z) return i;
    }
    if (!add) return -1;
    if (this.count >= this.most) throw new PageError('the page has more voxels than it says');
    const own = this.count++;
    place[3 * own] = x;
    place[3 * own + 1] = y;
    place[3 * own + 2] = z;
    return this.slot[at] = own;
  }
}

// The tree has the top cells, then nodes of eight entries each: a cell, -1 nothing, -2 - n node n.

// -> {vertices, top, tree, corner [8 cells]}
function placesOfTree(bytes, voxels, finest, count) {
  const top = voxels.map((n) => n >> finest), topCells = top[0] * top[1] * top[2];
  let cells = 0, nodes = 0;
  for (const byte of bytes)
    for (let s = 0; s < 8; s += 2) {
      cells += (byte >> s & 3) === 1;
      nodes += (byte >> s & 3) === 2;
    }
  const vertices = new Vertices(count), tree = new Int32Array(topCells + 8 * nodes).fill(-1);
  const corner = new Int32Array(8 * cells), own = new Int32Array(8), {earlier, width} = vertices;
  // The vertices of a node's children that are known already, [levels, 3, 3, 3]: half of all would be found again.
  const known = new Int32Array(27 * (finest + 1));
  let symbol = 0, cell = 0, node = 0, predicted = 0;

  // `child` of the node whose vertices begin at `of` of `known`; -1: a top cell.
  function addCell(x, y, z, log2, child, of) {
    const side = 1 << log2, first = child < 0 ? 0 : of + 9 * (child >> 2) + 3 * (child >> 1 & 1) + (child & 1);
    for (let k = 0; k < 8; ++k) {
      const at = first + 9 * (k >> 2) + 3 * (k >> 1 & 1) + (k & 1);
      let i = child < 0 ? -1 : known[at];
      if (i < 0) {
        i = vertices.find(x + (k >> 2) * side, y + (k >> 1 & 1) * side, z + (k & 1) * side, true);
        if (child >= 0) known[at] = i;
      }
      own[k] = i;
      if (width[i] < log2) width[i] = log2;
      corner[8 * cell + k] = i;
    }
    for (let k = 0; k < 8; ++k) {
      const i = own[k];
      if (i < predicted) continue;
      predicted = i + 1;
      let n = 0;
      for (let edge = 1; edge < 8; edge *= 2)
        if (own[k ^ edge] < i) earlier[3 * i + n++] = own[k ^ edge];
      if (n === 0) earlier[3 * i] = i - 1;
    }
    return cell++;
  }
  function visit(x, y, z, level, child, of) {
    if (symbol >> 2 >= bytes.length) throw new PageError('the tree of cells ends too early');
    const kind = bytes[symbol >> 2] >> 2 * (symbol & 3) & 3;
    ++symbol;
    if (kind === 0) return -1;
    if (kind === 1) return addCell(x, y, z, finest - level, child, of);
    if (kind !== 2 || level >= finest) throw new PageError('the tree of cells is damaged');
    const first = topCells + 8 * node, entry = -2 - node++, half = 1 << finest - level - 1, own = 27 * level;
    known.fill(-1, own, own + 27);
    for (let k = 0; k < 8; ++k)
      tree[first + k] = visit(x + (k >> 2) * half, y + (k >> 1 & 1) * half, z + (k & 1) * half, level + 1, k, own);
    return entry;
  }
  let at = 0;
  for (let x = 0; x < top[0]; ++x)
    for (let y = 0; y < top[1]; ++y)
      for (let z = 0; z < top[2]; ++z) tree[at++] = visit(x << finest, y << finest, z << finest, 0, -1, 0);
  return {vertices, top, tree, corner, finest};
}

// The same of a uniform grid: its voxels first, cells and a tree around them by cellsOfGrid.
function placesOfMask(bytes, voxels, count) {
  const brick = 8, bricks = voxels.map((n) => Math.ceil(n / brick));
  const flags = bricks[0] * bricks[1] * bricks[2];
  const vertices = new Vertices(count);
  let next = Math.ceil(flags / 8), at = 0;
  for (let x = 0; x < bricks[0]; ++x)
    for (let y = 0; y < bricks[1]; ++y)
      for (let z = 0; z < bricks[2]; ++z, ++at) {
        if (!(bytes[at >> 3] >> (at & 7) & 1)) continue;
        if (next + 64 > bytes.length) throw new PageError('the mask of voxels ends too early');
        for (let i = 0; i < 512; ++i) {
          const p = [x * brick + (i >> 6), y * brick + (i >> 3 & 7), z * brick + (i & 7)];
          if (p[0] >= voxels[0] || p[1] >= voxels[1] || p[2] >= voxels[2]) continue;
          if (!(bytes[next + (i >> 3)] >> (i & 7) & 1)) continue;
          const own = vertices.find(p[0], p[1], p[2], true);
          let n = 0;
          for (let a = 0; a < 3; ++a) {
            const before = p.slice();
            --before[a];
            const other = vertices.find(before[0], before[1], before[2], false);
            if (other >= 0) vertices.earlier[3 * own + n++] = other;
          }
          if (n === 0) vertices.earlier[3 * own] = own - 1;
        }
        next += 64;
      }
  return vertices;
}

// Cells of a uniform grid that a ray can see, in a tree of cubes of eight. A corner without a
// voxel is voxel `count`, whose values are 0. `number`: densities, positive where light is stopped.
function cellsOfGrid(vertices, voxels, number) {
  const finest = 3, top = voxels.map((n) => Math.ceil((n - 1) / 8));
  const found = new Map(), {place, count} = vertices;
  const seen = new Map();  // of a cube: the cells in it
  for (let i = 0; i < count; ++i) {
    if (number[i] <= 0) continue;
    for (let k = 0; k < 8; ++k) {
      const x = place[3 * i] - (k >> 2), y = place[3 * i + 1] - (k >> 1 & 1), z = place[3 * i + 2] - (k & 1);
      if (x < 0 || y < 0 || z < 0 || x > voxels[0] - 2 || y > voxels[1] - 2 || z > voxels[2] - 2) continue;
      const cube = ((x >> 3) * top[1] + (y >> 3)) * top[2] + (z >> 3);
      let mask = seen.get(cube);
      if (!mask) seen.set(cube, mask = new Uint8Array(512));
      mask[(x & 7) << 6 | (y & 7) << 3 | z & 7] = 1;
    }
  }
  const topCells = top[0] * top[1] * top[2], tree = [], corner = [];
  const head = new Int32Array(topCells).fill(-1);
  function build(mask, low, x, y, z, width) {
    if (width === 1) {
      if (!mask[x << 6 | y << 3 | z]) return -1;
      for (let k = 0; k < 8; ++k) {
        const p = cornerOf([low[0] + x, low[1] + y, low[2] + z], 1, k);
        const i = vertices.find(p[0], p[1], p[2], false);
        corner.push(i < 0 ? count : i);
      }
      return corner.length / 8 - 1;
    }
    const half = width / 2, entry = [];
    const saved = corner.length;
    for (let k = 0; k < 8; ++k) {
      const p = cornerOf([x, y, z], half, k);
      entry.push(build(mask, low, p[0], p[1], p[2], half));
    }
    if (corner.length === saved) return -1;
    const node = tree.length / 8;
    for (const e of entry) tree.push(e);
    return -2 - node;
  }
  for (const [cube, mask] of seen) {
    const z = cube % top[2], y = Math.floor(cube / top[2]) % top[1], x = Math.floor(cube / top[2] / top[1]);
    head[cube] = build(mask, [8 * x, 8 * y, 8 * z], 0, 0, 0, 8);
  }
  const all = new Int32Array(topCells + tree.length).fill(-1);
  all.set(head);
  all.set(tree, topCells);
  return {vertices, top, tree: all, corner: Int32Array.from(corner), finest};
}

// Columns of the spheres: {links [2R, R], place [columns], earlier}
function placesOfSpheres(bytes, resolution, layers) {
  const texels = 2 * resolution * resolution, links = new Int32Array(texels).fill(-1);
  const place = [], earlier = [];
  for (let at = 0; at < texels; ++at) {
    if (!(bytes[at >> 3] >> (at & 7) & 1)) continue;
    const own = place.length;
    links[at] = own;
    place.push(at);
    const north = at % resolution > 0 ? links[at - 1] : -1;
    const west = at >= resolution ? links[at - resolution] : -1;
    for (let i = 0; i < layers; ++i) {
      const others = [i > 0 ? own * layers + i - 1 : -1, north >= 0 ? north * layers + i : -1,
                      west >= 0 ? west * layers + i : -1].filter((o) => o >= 0);
      earlier.push(others[0] ?? -1, others[1] ?? -1, others[2] ?? -1);
    }
  }
  return {links, place: Int32Array.from(place), earlier: Int32Array.from(earlier)};
}
