// The networks' pass on the processor's cores, where there is no fast graphics processor.

// What a worker runs; it must not use anything outside itself. See network.glsl.
function workerOfStyle() {
  let task;
  const activations = [(x) => Math.sin(task.omega * x), (x) => Math.max(x, 0), (x) => Math.max(x, 0.01 * x),
                       (x) => 1 / (1 + Math.exp(-x)), (x) => Math.tanh(x)];
  onmessage = ({data}) => {
    if (data.layers) return void (task = data);
    const {first, second, extra, key} = data, n = first.length / 4, own = extra && new Uint8Array(extra.buffer);
    const from = [new Uint8Array(first.buffer), new Uint8Array(second.buffer)];
    const activate = activations[task.activation], {layers, base, constant} = task;
    let x = new Float64Array(64), y = new Float64Array(64);
    const s = new Float64Array(30);
    for (let v = 0; v < n; ++v) {
      const b = second[4 * v + 3];
      if (b >>> 31) {
        first.fill(0x80808080, 4 * v, 4 * v + 4);
        second.fill(0x80808080, 4 * v, 4 * v + 4);
        continue;
      }
      for (let i = 0; i < 27; ++i) s[i] = ((i < 16 ? from[0][16 * v + i] : from[1][16 * v + i - 16]) - 128) * task.scale[i];
      const place = [from[1][16 * v + 11] | (b & 31) << 8, b >>> 5 & 8191, b >>> 18 & 8191];
      for (let a = 0; a < 3; ++a) s[27 + a] = ((place[a] + task.shift) * task.unit[a] - 1) * task.positionScale;
      x.set(s);
      for (let l = 0; l < 6; ++l) {
        // Weights [inputs, outputs], outputs a multiple of 4.
        const {weight, bias, inputs, outputs} = layers[l];
        for (let o = 0; o < outputs; o += 4) {
          let y0 = bias[o], y1 = bias[o + 1], y2 = bias[o + 2], y3 = bias[o + 3];
          for (let i = 0, k = o; i < inputs; ++i, k += outputs) {
            const xi = x[i];
            y0 += weight[k] * xi;
            y1 += weight[k + 1] * xi;
            y2 += weight[k + 2] * xi;
            y3 += weight[k + 3] * xi;
          }
          y[o] = y0; y[o + 1] = y1; y[o + 2] = y2; y[o + 3] = y3;
        }
        if (l < 5) for (let o = 0; o < outputs; ++o) y[o] = activate(y[o]);
        [x, y] = [y, x];
      }
      for (let j = 0; j < 27; ++j) {
        const c = Math.floor(j / 9), k = j % 9;
        let value = x[j] + base[3 * c] * s[k] + base[3 * c + 1] * s[9 + k] + base[3 * c + 2] * s[18 + k] +
            (k === 0 ? constant[c] : 0);
        if (own) {
          const at = 8 * v, weight = own[at + 3] / 255;
          value = k === 0 ? value + (own[at + c] - 128) * task.residualScale[c] : value * own[at + 4 + c] / 255;
          value = (1 - weight) * s[j] + weight * value;
        }
        const code = Math.floor(Math.max(-127, Math.min(127, value / task.styledScale[j])) + 128.5);
        if (j < 16) from[0][16 * v + j] = code; else from[1][16 * v + j - 16] = code;
      }
    }
    postMessage({first, second, key}, [first.buffer, second.buffer]);
  };
}

// Fills `colors` from the source, strip by strip; `layers` as loadWeights has them.
async function restyleOnCores(graphics, scene, style, layers, residual, colors, progress) {
  const gl = graphics.gl, url = URL.createObjectURL(new Blob(['(' + workerOfStyle + ')()'], {type: 'text/javascript'}));
  const height = scene.source.first.height, rows = 8, framebuffer = gl.createFramebuffer();
  const read = (texture, y, count) => {
    const data = new Uint32Array(4 * WIDTH * count);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture.texture, 0);
    gl.readPixels(0, y, WIDTH, count, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data);
    return data;
  };
  const write = (texture, y, data) => {
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture.texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y, WIDTH, data.length / 4 / WIDTH, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data);
  };
  const setup = {layers, base: style.base, constant: style.constant, scale: scene.source.scale, styledScale: style.scale,
                 omega: style.omega, activation: style.activation, positionScale: style.position_scale,
                 residualScale: style.residual?.scale ?? [0, 0, 0], unit: scene.positionUnit, shift: scene.header.finest === null ? 0.5 : 0};
  let next = 0, done = 0;
  const workers = Array.from({length: Math.max(1, Math.min(8, navigator.hardwareConcurrency || 2))}, () => new Worker(url));
  try {
    await Promise.all(workers.map((worker) => new Promise((finish, fail) => {
      const give = () => {
        if (next >= height) return finish();
        const y = next, count = Math.min(rows, height - y);
        next += count;
        const first = read(scene.source.first, y, count), second = read(scene.source.second, y, count);
        const extra = residual?.slice(2 * WIDTH * y, 2 * WIDTH * (y + count));
        worker.postMessage({first, second, extra, key: y}, [first.buffer, second.buffer, ...extra ? [extra.buffer] : []]);
      };
      worker.onerror = (event) => fail(new PageError('this browser runs no workers: ' + event.message));
      worker.onmessage = ({data}) => {
        write(colors.first, data.key, data.first);
        write(colors.second, data.key, data.second);
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
