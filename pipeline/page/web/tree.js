// The tree of cells as a ray reads it: one texel of four 32-bit words for each cell and each node of two levels.
//
// The top cubes come first, then blocks of what the nodes hold, in the order of its bits; a node names its block. A node is
// a cube with eight children and their eight children each: bit 8 c + g of 64 is for grandchild g of child c. So a ray reads
// one texel for two levels, and empty space costs none.
//   node     2^31 | first texel of its block, 0, mask of grandchildren (no bit: nothing there)
//   cell     number of the cell, in the order of the tree, densities of its eight corners in 12 bits each
// A density is stored as v = sign(d) sqrt(|d| / kOpticalDepth), d for each voxel, in quarters from
// -512 to 511.75: the page's own steps are 1, and more than 104 optical depths in a cell are as
// opaque as 104.

const OPTICAL_DEPTH = 4e-4;  // kPageOpticalDepth of value_codec.h

const densityCode = (root) => Math.max(0, Math.min(4095, Math.round(4 * root) + 2048));

// The same tree under fewer top cubes: a ray crosses what is empty in large cubes. All levels are in pairs then.
function raisedTree({top, tree, finest, ...rest}) {
  const below = top[0] * top[1] * top[2], added = [];
  let heads = tree.subarray(0, below), nodes = (tree.length - below) / 8;
  for (; finest < 16 && (Math.max(...top) > 4 || finest % 2 === 1); ++finest) {
    const wide = top, next = top = wide.map((n) => Math.ceil(n / 2));
    const raised = new Int32Array(next[0] * next[1] * next[2]).fill(-1);
    for (let at = 0; at < raised.length; ++at) {
      const low = [Math.floor(at / next[1] / next[2]), Math.floor(at / next[2]) % next[1], at % next[2]].map((n) => 2 * n);
      const children = Array.from({length: 8}, (_, k) => {
        const p = [low[0] + (k >> 2), low[1] + (k >> 1 & 1), low[2] + (k & 1)];
        return p.some((v, a) => v >= wide[a]) ? -1 : heads[(p[0] * wide[1] + p[1]) * wide[2] + p[2]];
      });
      if (children.every((c) => c === -1)) continue;
      added.push(...children);
      raised[at] = -2 - nodes++;
    }
    heads = raised;
  }
  const all = new Int32Array(heads.length + 8 * nodes);
  all.set(heads);
  all.set(tree.subarray(below), heads.length);
  all.set(added, all.length - added.length);
  return {top, tree: all, finest, ...rest};
}

// `root(voxel)`: sign(d) sqrt(|d| / OPTICAL_DEPTH); `places`: see raisedTree. -> {tree, order: cells as they are numbered in it}
function packedTree(places, root) {
  const {tree, corner} = places, topCubes = places.top[0] * places.top[1] * places.top[2];
  const order = new Int32Array(corner.length / 8);
  const packed = new Uint32Array(4 * (topCubes + order.length + (tree.length - topCubes) / 8));  // nodes of half the levels have none
  let end = topCubes, numbered = 0;  // of the blocks so far; cells
  const code = new Uint32Array(8);
  const first = (entry) => topCubes + 8 * (-2 - entry);  // of a node's children

  function putCell(at, entry) {
    for (let k = 0; k < 8; ++k) code[k] = densityCode(root(corner[8 * entry + k]));
    packed[4 * at] = numbered;
    order[numbered++] = entry;
    packed[4 * at + 1] = code[0] | code[1] << 12 | code[6] << 24;
    packed[4 * at + 2] = code[2] | code[3] << 12 | (code[6] >> 8) << 24 | code[7] << 28;
    packed[4 * at + 3] = code[4] | code[5] << 12 | (code[7] >> 4) << 24;
  }
  function put(at, entry) {
    if (entry >= 0) return putCell(at, entry);
    packed[4 * at] = 2 ** 31;
    if (entry === -1) return;
    const children = first(entry), block = end;
    packed[4 * at] += block;
    for (let c = 0; c < 8; ++c) {
      const child = tree[children + c];
      if (child === -1) continue;
      for (let g = 0; g < 8; ++g) {
        if (tree[first(child) + g] === -1) continue;
        packed[4 * at + 2 + (c >> 2)] |= 1 << (8 * (c & 3) + g);
        ++end;
      }
    }
    for (let c = 0, next = block; c < 8; ++c) {
      const child = tree[children + c];
      if (child === -1) continue;
      for (let g = 0; g < 8; ++g)
        if (tree[first(child) + g] !== -1) put(next++, tree[first(child) + g]);
    }
  }
  for (let i = 0; i < topCubes; ++i) put(i, tree[i]);
  return {tree: packed.subarray(0, 4 * end), order};
}
