// Places of voxels, and the tree in which a ray finds them; pipeline/page/page_order.h says how
// they are stored.

const onesOfByte = Uint8Array.from({length: 256}, (_, b) => {
  let ones = 0;
  for (; b > 0; b >>= 1) ones += b & 1;
  return ones;
});

// The voxels of a mask in their order. A brick has 8 x 8 rows along z: a byte, of whose bits one is set for each voxel, and
// the number of voxels before it. So a voxel's number is found from its place without a table of places.
class Vertices {
  constructor(mask, voxels, most) {
    const [nx, ny, nz] = this.bricks = voxels.map((n) => Math.ceil(n / 8)), flags = nx * ny * nz, begin = Math.ceil(flags / 8);
    const has = (at) => mask[at >> 3] >> (at & 7) & 1;
    let stored = 0;
    if (mask.length >= begin) for (let at = 0; at < flags; ++at) stored += has(at);
    if (mask.length < begin + 64 * stored) throw new PageError('the mask of voxels ends too early');
    this.none = 64 * stored;  // first row of an empty brick, which stands for those that aren't stored
    this.row = new Int32Array(flags).fill(this.none);
    this.bits = new Uint8Array(64 * (stored + 1));
    this.before = new Int32Array(64 * (stored + 1));
    let row = 0, count = 0;
    for (let x = 0, at = 0; x < nx; ++x)
      for (let y = 0; y < ny; ++y)
        for (let z = 0; z < nz; ++z, ++at) {
          if (!has(at)) continue;
          this.row[at] = row;
          for (let r = 0; r < 64; ++r, ++row) {
            this.bits[row] = mask[begin + row] & rowInside(voxels, x, y, z, r);
            this.before[row] = count;
            count += onesOfByte[this.bits[row]];
          }
        }
    if (count > most) throw new PageError('the page has more voxels than it says');
    this.count = count;
    this.place = new Int32Array(3 * count);
    this.earlier = new Int32Array(3 * count).fill(-1);
    for (let x = 0; x < nx; ++x)
      for (let y = 0; y < ny; ++y)
        for (let z = 0; z < nz; ++z) if (this.rowOf(x, y, z) !== this.none) this.putBrick(x, y, z);
  }
  // The first row of a brick, which may be outside.
  rowOf(x, y, z) {
    const [nx, ny, nz] = this.bricks;
    return x < 0 || y < 0 || z < 0 || x >= nx || y >= ny || z >= nz ? this.none : this.row[(x * ny + y) * nz + z];
  }
  // Places of a brick's voxels, and the neighbours before them.
  putBrick(x, y, z) {
    const {bits, before, place, earlier} = this, first = this.rowOf(x, y, z);
    const beforeX = this.rowOf(x - 1, y, z), beforeY = this.rowOf(x, y - 1, z), beforeZ = this.rowOf(x, y, z - 1);
    for (let r = 0, own = before[first]; r < 64; ++r) {
      const all = bits[first + r], c = beforeZ + r;
      const a = r >> 3 ? first + r - 8 : beforeX + r + 56, b = r & 7 ? first + r - 1 : beforeY + r + 7;
      for (let k = 0; k < 8; ++k) {
        if (!(all >> k & 1)) continue;
        const lower = (1 << k) - 1;
        let n = 3 * own;
        if (bits[a] >> k & 1) earlier[n++] = before[a] + onesOfByte[bits[a] & lower];
        if (bits[b] >> k & 1) earlier[n++] = before[b] + onesOfByte[bits[b] & lower];
        if (k > 0 ? all >> k - 1 & 1 : bits[c] >> 7) earlier[n++] = k > 0 ? own - 1 : before[c] + onesOfByte[bits[c]] - 1;
        if (n === 3 * own) earlier[n] = own - 1;
        place[3 * own] = 8 * x + (r >> 3);
        place[3 * own + 1] = 8 * y + (r & 7);
        place[3 * own++ + 2] = 8 * z + k;
      }
    }
  }
}

// The bits of row r of a brick that are inside of a box.
function rowInside(size, x, y, z, r) {
  return 8 * x + (r >> 3) < size[0] && 8 * y + (r & 7) < size[1] ? (1 << Math.max(0, Math.min(8, size[2] - 8 * z))) - 1 : 0;
}

// Bits of n x n x n places, in rows along z, as those of places twice as wide: set where one of the eight is.
function widened(rows, n, into) {
  for (let x = 0, at = 0; x < n; x += 2)
    for (let y = 0; y < n; y += 2, ++at) {
      let b = rows[x * n + y] | rows[x * n + y + 1] | rows[x * n + n + y] | rows[x * n + n + y + 1];
      b |= b >> 1;
      into[at] = b & 1 | b >> 1 & 2 | b >> 2 & 4 | b >> 3 & 8;
    }
}

// The cells that a ray can see, cube of eight by cube: those with a corner where light is stopped. `seen` are their bits in rows
// along z, of one cell, and of two and of four along an edge.
class SeenCells {
  constructor(vertices, voxels, number) {
    const {bits, before} = vertices, stops = new Uint8Array(bits.length);
    for (let row = 0; row < bits.length; ++row)
      for (let k = 0, i = before[row]; bits[row] >> k > 0; ++k)
        if (bits[row] >> k & 1 && number[i++] > 0) stops[row] |= 1 << k;
    Object.assign(this, {vertices, stops, inside: voxels.map((n) => n - 1), rows: new Int32Array(8), wide: new Uint16Array(81),
                         seen: [new Uint8Array(64), new Uint8Array(16), new Uint8Array(4)]});
  }
  // False if there is none in a cube.
  find(x, y, z) {
    const {vertices, stops, inside, rows, wide, seen} = this;
    let any = false;
    for (let k = 0; k < 8; ++k) {
      rows[k] = vertices.rowOf(x + (k >> 2), y + (k >> 1 & 1), z + (k & 1));
      any ||= rows[k] !== vertices.none;
    }
    if (!any) return false;
    for (let i = 0, at = 0; i < 9; ++i)
      for (let j = 0; j < 9; ++j, ++at) {
        const k = (i >> 3) << 2 | (j >> 3) << 1, r = (i & 7) << 3 | j & 7;
        wide[at] = stops[rows[k] + r] | stops[rows[k + 1] + r] << 8;
      }
    any = false;
    for (let r = 0; r < 64; ++r) {
      const at = 9 * (r >> 3) + (r & 7), b = wide[at] | wide[at + 1] | wide[at + 9] | wide[at + 10];
      seen[0][r] = (b | b >> 1) & rowInside(inside, x, y, z, r);
      any ||= seen[0][r] > 0;
    }
    widened(seen[0], 8, seen[1]);
    widened(seen[1], 4, seen[2]);
    return any;
  }
  // The voxels at the 9 x 9 x 9 corners of the cube that was found last, `vertices.count` where there is none.
  putVoxels(into) {
    const {bits, before, count} = this.vertices;
    for (let i = 0, at = 0; i < 9; ++i)
      for (let j = 0; j < 9; ++j) {
        const k = (i >> 3) << 2 | (j >> 3) << 1, r = (i & 7) << 3 | j & 7, low = this.rows[k] + r, high = this.rows[k + 1] + r;
        for (let b = bits[low], n = before[low], l = 0; l < 8; ++l) into[at++] = b >> l & 1 ? n++ : count;
        into[at++] = bits[high] & 1 ? before[high] : count;
      }
  }
}

// The tree has the top cubes, then nodes of eight entries each: a cell, -1 nothing, -2 - n node n. A corner without a voxel is
// voxel `count`, whose values are 0. `number`: densities, positive where light is stopped. -> {top, tree, corner [8 cells], finest}
function cellsOfGrid(vertices, voxels, number) {
  const finest = 3, top = voxels.map((n) => Math.ceil((n - 1) / 8)), topCubes = top[0] * top[1] * top[2];
  const found = new SeenCells(vertices, voxels, number), {seen} = found;
  const eachCube = (visit) => {
    for (let x = 0, at = 0; x < top[0]; ++x)
      for (let y = 0; y < top[1]; ++y)
        for (let z = 0; z < top[2]; ++z, ++at) if (found.find(x, y, z)) visit(at);
  };
  let cells = 0, nodes = 0;
  const count = (rows) => rows.reduce((sum, b) => sum + onesOfByte[b], 0);
  eachCube(() => {
    cells += count(seen[0]);
    nodes += count(seen[1]) + count(seen[2]) + 1;
  });
  const tree = new Int32Array(topCubes + 8 * nodes).fill(-1), corner = new Int32Array(8 * cells), voxel = new Int32Array(729);
  cells = nodes = 0;
  function putCell(x, y, z) {
    for (let k = 0, low = 81 * x + 9 * y + z; k < 8; ++k)
      corner[8 * cells + k] = voxel[low + 81 * (k >> 2) + 9 * (k >> 1 & 1) + (k & 1)];
    return cells++;
  }
  // The node at a place of cubes 2 << level wide, of whose children one or more are seen.
  function putNode(level, x, y, z) {
    const node = nodes++, first = topCubes + 8 * node, across = 8 >> level;
    for (let k = 0; k < 8; ++k) {
      const a = 2 * x + (k >> 2), b = 2 * y + (k >> 1 & 1), c = 2 * z + (k & 1);
      if (!(seen[level][a * across + b] >> c & 1)) continue;
      tree[first + k] = level > 0 ? putNode(level - 1, a, b, c) : putCell(a, b, c);
    }
    return -2 - node;
  }
  eachCube((at) => {
    found.putVoxels(voxel);
    tree[at] = putNode(2, 0, 0, 0);
  });
  return {top, tree, corner, finest};
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
