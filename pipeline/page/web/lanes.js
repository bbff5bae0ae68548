// A layer of a network for eight splats at once, as a WebAssembly program that is assembled here: browsers run it on four
// numbers an instruction. It has two functions, addresses in bytes:
//   layer(x, y, weights, bias, inputs, blocks): y[4 blocks][8] = bias + sum over inputs of weights[block][input][4] x[input][8]
//   sine(x, count, omega): x[count][4] = sin(omega x)

function lanesProgram() {
  const leb = (n) => n < 128 ? [n] : [n & 127 | 128, ...leb(n >> 7)];
  const signed = (n) => n >= -64 && n < 64 ? [n & 127] : [n & 127 | 128, ...signed(n >> 7)];
  const sized = (bytes) => [...leb(bytes.length), ...bytes];
  const section = (id, items) => [id, ...sized([...leb(items.length), ...items.flat()])];
  const I32 = 0x7f, F32 = 0x7d, V128 = 0x7b;
  const get = (n) => [0x20, n], set = (n) => [0x21, n], tee = (n) => [0x22, n], number = (n) => [0x41, ...signed(n)];
  const lanes = (code) => [0xfd, ...leb(code)];
  const at = (code, offset, align) => [...lanes(code), align, ...leb(offset)];
  const load = (offset) => at(0, offset, 4), store = (offset) => at(11, offset, 4), splatFrom = (offset) => at(9, offset, 2);
  const add = lanes(228), sub = lanes(229), mul = lanes(230), nearest = lanes(106), toInteger = lanes(248), shiftLeft = lanes(171),
        xor = lanes(81), splat = lanes(19);
  const constant = (value) => [0x43, ...new Uint8Array(new Float32Array([value]).buffer), ...splat];
  const advance = (local, by) => [...get(local), ...number(by), 0x6a, ...set(local)];
  const repeat = (counter, body) => [0x03, 0x40, ...body, ...get(counter), ...number(1), 0x6b, ...tee(counter), 0x0d, 0, 0x0b];
  const four = [0, 1, 2, 3], each = (of) => four.flatMap(of);

  const [x, y, weights, bias, inputs, blocks, left, from] = [0, 1, 2, 3, 4, 5, 6, 7], x0 = 16, x1 = 17, w = 18;
  const sum = (o, half) => 8 + 2 * o + half;
  const layer = repeat(blocks, [
    ...each((o) => [...get(bias), ...splatFrom(4 * o), ...tee(sum(o, 0)), ...set(sum(o, 1))]),
    ...get(x), ...set(from), ...get(inputs), ...set(left),
    ...repeat(left, [
      ...get(from), ...load(0), ...set(x0), ...get(from), ...load(16), ...set(x1),
      ...each((o) => [...get(weights), ...splatFrom(4 * o), ...set(w),
                      ...get(sum(o, 0)), ...get(w), ...get(x0), ...mul, ...add, ...set(sum(o, 0)),
                      ...get(sum(o, 1)), ...get(w), ...get(x1), ...mul, ...add, ...set(sum(o, 1))]),
      ...advance(weights, 16), ...advance(from, 32)]),
    ...each((o) => [0, 1].flatMap((half) => [...get(y), ...get(sum(o, half)), ...store(32 * o + 16 * half)])),
    ...advance(y, 128), ...advance(bias, 16)]);

  // sin(r + k pi) = (-1)^k sin(r), |r| <= pi / 2, pi in two parts; the series to r^11 is within 6e-8.
  const [row, count, omega, r, k, square] = [0, 1, 2, 3, 4, 5];
  const series = [-1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800].reverse();
  const sine = repeat(count, [
    ...get(row), ...load(0), ...get(omega), ...splat, ...mul, ...tee(r), ...constant(1 / Math.PI), ...mul, ...nearest, ...set(k),
    ...get(r), ...get(k), ...constant(3.140625), ...mul, ...sub, ...get(k), ...constant(Math.PI - 3.140625), ...mul, ...sub, ...tee(r),
    ...get(r), ...mul, ...set(square),
    ...get(row),
    ...constant(series[0]), ...series.slice(1).flatMap((c) => [...get(square), ...mul, ...constant(c), ...add]),
    ...get(square), ...mul, ...get(r), ...mul, ...get(r), ...add,
    ...get(k), ...toInteger, ...number(31), ...shiftLeft, ...xor, ...store(0),
    ...advance(row, 16)]);

  const locals = (...groups) => [...leb(groups.length), ...groups.flat()];
  const name = (text) => sized([...text].map((c) => c.charCodeAt(0)));
  const body = (declared, code) => sized([...declared, ...code, 0x0b]);
  return new Uint8Array([0, 0x61, 0x73, 0x6d, 1, 0, 0, 0,
    ...section(1, [[0x60, ...sized([I32, I32, I32, I32, I32, I32]), 0], [0x60, ...sized([I32, I32, F32]), 0]]),
    ...section(3, [[0], [1]]),
    ...section(5, [[0, 4]]),  // pages of 64 KiB
    ...section(7, [[...name('memory'), 2, 0], [...name('layer'), 0, 0], [...name('sine'), 0, 1]]),
    ...section(10, [body(locals([2, I32], [11, V128]), layer), body(locals([3, V128]), sine)])]);
}
