// The networks' pass on the processor's cores, where there is no fast graphics processor.

// What a worker runs; it must not use anything outside itself. See network.glsl.
function workerOfStyle() {
  const X = 0, Y = 4096, FIRST = 8192;  // in floats: a layer's eight splats, the next one's, weights and biases
  let task, floats, functions;
  const activations = [(x) => Math.sin(task.omega * x), (x) => Math.max(x, 0), (x) => Math.max(x, 0.01 * x),
                       (x) => 1 / (1 + Math.exp(-x)), (x) => Math.tanh(x)];
  // As those of lanes.js, where WebAssembly is not allowed: two splats at once, so that a weight is read once for both.
  const plain = {
    layer(x, y, weights, bias, inputs, blocks) {
      [x, y, weights, bias] = [x / 4, y / 4, weights / 4, bias / 4];
      for (let q = 0; q < blocks; ++q)
        for (let h = 0; h < 8; h += 2) {
          const b = bias + 4 * q, to = y + 32 * q + h;
          let a0 = floats[b], a1 = floats[b + 1], a2 = floats[b + 2], a3 = floats[b + 3], b0 = a0, b1 = a1, b2 = a2, b3 = a3;
          for (let i = 0, k = weights + 4 * inputs * q, at = x + h; i < inputs; ++i, k += 4, at += 8) {
            const xa = floats[at], xb = floats[at + 1], w0 = floats[k], w1 = floats[k + 1], w2 = floats[k + 2], w3 = floats[k + 3];
            a0 += w0 * xa; b0 += w0 * xb;
            a1 += w1 * xa; b1 += w1 * xb;
            a2 += w2 * xa; b2 += w2 * xb;
            a3 += w3 * xa; b3 += w3 * xb;
          }
          floats[to] = a0; floats[to + 8] = a1; floats[to + 16] = a2; floats[to + 24] = a3;
          floats[to + 1] = b0; floats[to + 9] = b1; floats[to + 17] = b2; floats[to + 25] = b3;
        }
    }};
  function begin() {
    try {
      functions = new WebAssembly.Instance(new WebAssembly.Module(task.program)).exports;
      floats = new Float32Array(functions.memory.buffer);
    } catch (error) {
      functions = plain;
      floats = new Float32Array(1 << 16);
    }
    let next = FIRST;
    for (const layer of task.layers) {
      const {weight, bias, inputs, outputs} = layer;
      layer.weights = 4 * next;
      for (let q = 0; q < outputs; q += 4) for (let i = 0; i < inputs; ++i) for (let k = 0; k < 4; ++k) floats[next++] = weight[i * outputs + q + k];
      layer.biases = 4 * next;
      for (const b of bias) floats[next++] = b;
    }
  }
  // Numbers of 27 coefficients, [channel, harmonic], and back: `to` is y = opponent s harmonics^T.
  const turned = new Float64Array(27);
  function fromNumbers({opponent, harmonics}, q, s) {
    for (let j = 0; j < 9; ++j)
      for (let c = 0; c < 3; ++c) turned[9 * c + j] = opponent[c] * q[j] + opponent[3 + c] * q[9 + j] + opponent[6 + c] * q[18 + j];
    s.fill(0);
    for (let c = 0; c < 27; c += 9)
      for (let j = 0; j < 9; ++j) for (let k = 0; k < 9; ++k) s[c + k] += harmonics[9 * j + k] * turned[c + j];
  }
  function toNumbers({opponent, harmonics}, s, q) {
    turned.fill(0);
    for (let c = 0; c < 27; c += 9)
      for (let j = 0; j < 9; ++j) for (let k = 0; k < 9; ++k) turned[c + j] += harmonics[9 * j + k] * s[c + k];
    for (let j = 0; j < 9; ++j)
      for (let a = 0; a < 3; ++a)
        q[9 * a + j] = opponent[3 * a] * turned[j] + opponent[3 * a + 1] * turned[9 + j] + opponent[3 * a + 2] * turned[18 + j];
  }
  onmessage = ({data}) => {
    if (data.layers) {
      task = data;
      return void begin();
    }
    const {color, place, extra, key} = data, n = color.length / 4, own = extra && new Uint8Array(extra.buffer);
    const activate = activations[task.activation], {layers, base, constant, from, to} = task;
    const {word: fromWord, above: fromAbove, unused: fromUnused} = from, {word: toWord, above: toAbove, unused: toUnused} = to;
    const most = toUnused.map((unused) => 2 ** (31 - unused) - 1);
    const s = Array.from({length: 8}, () => new Float64Array(27)), q = new Float64Array(27), r = new Float64Array(27);
    for (let begin = 0; begin < n; begin += 8) {
      for (let h = 0; h < 8; ++h) {
        const v = Math.min(begin + h, n - 1), a = place[2 * v], b = place[2 * v + 1];
        for (let i = 0; i < 27; ++i) {
          q[i] = (color[4 * v + fromWord[i]] << fromAbove[i] >> fromUnused[i]) * from.step[i];
        }
        fromNumbers(from, q, s[h]);
        for (let i = 0; i < 27; ++i) floats[X + 8 * i + h] = s[h][i];
        floats[X + 216 + h] = (((a & 65535) + task.shift) * task.unit[0] - 1) * task.positionScale;
        floats[X + 224 + h] = (((a >>> 16) + task.shift) * task.unit[1] - 1) * task.positionScale;
        floats[X + 232 + h] = (((b & 65535) + task.shift) * task.unit[2] - 1) * task.positionScale;
      }
      let x = X, y = Y;
      for (let l = 0; l < 6; ++l) {
        const {weights, biases, inputs, outputs} = layers[l];
        functions.layer(4 * x, 4 * y, weights, biases, inputs, outputs / 4);
        if (l < 5 && task.activation === 0 && functions.sine) functions.sine(4 * y, 2 * outputs, task.omega);
        else if (l < 5) for (let o = y; o < y + 8 * outputs; ++o) floats[o] = activate(floats[o]);
        [x, y] = [y, x];
      }
      for (let h = 0; h < 8 && begin + h < n; ++h) {
        const v = begin + h, source = s[h];
        color.fill(0, 4 * v, 4 * v + 4);
        for (let j = 0; j < 27; ++j) {
          const c = Math.floor(j / 9), k = j % 9;
          r[j] = floats[x + 8 * j + h] + base[3 * c] * source[k] + base[3 * c + 1] * source[9 + k] + base[3 * c + 2] * source[18 + k] +
              (k === 0 ? constant[c] : 0);
          if (!own) continue;
          const at = 8 * v, weight = own[at + 3] / 255;
          r[j] = k === 0 ? r[j] + (own[at + c] - 128) * task.residualScale[c] : r[j] * own[at + 4 + c] / 255;
          r[j] = (1 - weight) * source[j] + weight * r[j];
        }
        toNumbers(to, r, q);
        for (let i = 0; i < 27; ++i) {
          const number = Math.max(-most[i], Math.min(most[i], Math.floor(q[i] / to.step[i] + 0.5)));
          color[4 * v + toWord[i]] |= number << toUnused[i] >>> toAbove[i];
        }
      }
    }
    postMessage({color, key}, [color.buffer]);
  };
}

// Fills `colors` from the source, strip by strip; `layers` as loadWeights has them; `place` and `residual` of all splats.
async function restyleOnCores(graphics, scene, style, layers, {place, residual}, colors, progress) {
  const gl = graphics.gl, url = URL.createObjectURL(new Blob(['(' + workerOfStyle + ')()'], {type: 'text/javascript'}));
  const count = Math.max(1, Math.min(8, navigator.hardwareConcurrency || 2));
  const {height} = scene.source.color, rows = Math.min(8, Math.ceil(height / count)), framebuffer = gl.createFramebuffer();
  const kept = scene.kept.color && await asWords(scene.kept.color);
  const read = (texture, y, count) => {
    if (kept) return kept.slice(4 * WIDTH * y, 4 * WIDTH * (y + count));
    const data = new Uint32Array(4 * WIDTH * count);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture.texture, 0);
    gl.readPixels(0, y, WIDTH, count, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data);
    return data.subarray(0, 4 * Math.min(WIDTH * count, scene.count - WIDTH * y)).slice();
  };
  const write = (texture, y, data) => {
    const texels = data.length / 4, whole = Math.floor(texels / WIDTH), rest = texels % WIDTH;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture.texture);
    if (whole) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y, WIDTH, whole, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data, 0);
    if (rest) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y + whole, rest, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data, 4 * WIDTH * whole);
  };
  const withPlaces = ({opponent, harmonics, step, bits}) => {
    const places = placesOfNumbers(bits), column = (name) => Int32Array.from(places, (place) => place[name]);
    return {opponent: Float64Array.from(opponent), harmonics: Float64Array.from(harmonics), step: Float64Array.from(step),
            word: column('word'), above: column('above'), unused: column('unused')};
  };
  const setup = {layers, program: lanesProgram(), base: style.base, constant: style.constant, from: withPlaces(scene.source.code), to: withPlaces(colors.code),
                 omega: style.omega, activation: style.activation, positionScale: style.position_scale,
                 residualScale: style.residual?.scale ?? [0, 0, 0], unit: scene.positionUnit, shift: scene.shift};
  let next = 0, done = 0;
  const workers = Array.from({length: Math.min(count, Math.ceil(height / rows))}, () => new Worker(url));
  try {
    await Promise.all(workers.map((worker) => new Promise((finish, fail) => {
      const give = () => {
        if (next >= height) return finish();
        const y = next, count = Math.min(rows, height - y), part = (data) => data.slice(2 * WIDTH * y, 2 * WIDTH * (y + count));
        next += count;
        const color = read(scene.source.color, y, count), places = part(place), extra = residual ? part(residual) : null;
        worker.postMessage({color, place: places, extra, key: y}, [color.buffer, places.buffer, ...extra ? [extra.buffer] : []]);
      };
      worker.onerror = (event) => fail(new PageError('this browser runs no workers: ' + event.message));
      worker.onmessage = ({data}) => {
        write(colors.color, data.key, data.color);
        progress(Math.min(0.999, ++done * rows / height));
        give();
      };
      worker.postMessage(setup);
      give();
    })));
  } finally {
    workers.forEach((worker) => worker.terminate());
    URL.revokeObjectURL(url);
    gl.deleteFramebuffer(framebuffer);
  }
}
