// The tree of cells as a ray reads it: one texel of four 32-bit words for each cell and each node.
//
// The top cells come first, then blocks of the children that hold something, in the order of their
// bits; a node names its block and which children are there. So empty space costs no texel.
//   node     2^31 | first texel of its block, mask of children, 0, 0   (a mask of 0: nothing there)
//   cell     number of the cell, densities of its eight corners in 12 bits each
// A density is stored as v = sign(d) sqrt(|d| w / kOpticalDepth), d for each voxel and w the cell's
// width, in quarters from -512 to 511.75: the page's own steps are 1, and more than 104 optical
// depths in a cell are as opaque as 104.

const OPTICAL_DEPTH = 4e-4;  // kPageOpticalDepth of value_codec.h

const densityCode = (root) => Math.max(0, Math.min(4095, Math.round(4 * root) + 2048));

// `root(voxel)`: sign(d) sqrt(|d| / OPTICAL_DEPTH); `places`: see placesOfTree.
function packedTree(places, root) {
  const {tree, corner, finest} = places, topCells = places.top[0] * places.top[1] * places.top[2];
  let texels = topCells;
  for (let i = topCells; i < tree.length; ++i) texels += tree[i] !== -1;
  const packed = new Uint32Array(4 * texels), code = new Uint32Array(8);
  let end = topCells;  // of the blocks so far

  function put(at, entry, width) {
    if (entry >= 0) {
      const size = Math.sqrt(width);
      for (let k = 0; k < 8; ++k) code[k] = densityCode(root(corner[8 * entry + k]) * size);
      packed[4 * at] = entry;
      packed[4 * at + 1] = code[0] | code[1] << 12 | code[6] << 24;
      packed[4 * at + 2] = code[2] | code[3] << 12 | (code[6] >> 8) << 24 | code[7] << 28;
      packed[4 * at + 3] = code[4] | code[5] << 12 | (code[7] >> 4) << 24;
      return;
    }
    packed[4 * at] = 2 ** 31;
    if (entry === -1) return;
    const children = topCells + 8 * (-2 - entry), first = end;
    let mask = 0;
    for (let k = 0; k < 8; ++k) {
      if (tree[children + k] === -1) continue;
      mask |= 1 << k;
      ++end;
    }
    packed[4 * at] = 2 ** 31 + first;
    packed[4 * at + 1] = mask;
    for (let k = 0, next = first; k < 8; ++k)
      if (mask >> k & 1) put(next++, tree[children + k], width / 2);
  }
  for (let i = 0; i < topCells; ++i) put(i, tree[i], 2 ** finest);
  return packed;
}
