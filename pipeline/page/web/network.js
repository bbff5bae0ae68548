// A style: its network's weights, and the pass that sends each splat through it.

const STRIP = 256;  // rows of a pass, at most
const LAYERS = [[30, 64], [64, 64], [64, 64], [64, 64], [64, 64], [64, 27]];

// Of each layer: weights [inputs, outputs], outputs padded to a multiple of 4.
async function loadWeights(id) {
  const bytes = await bytesOf(id), half = new Uint16Array(bytes.buffer);
  const expected = LAYERS.reduce((sum, [i, o]) => sum + o * (i + 1), 0);
  if (half.length !== expected) throw new PageError('a part of the page is damaged: ' + id);
  let next = 0;
  return LAYERS.map(([inputs, outputs]) => {
    const padded = 4 * Math.ceil(outputs / 4);
    const layer = {inputs, outputs: padded, weight: new Float64Array(inputs * padded), bias: new Float64Array(padded)};
    for (let o = 0; o < outputs; ++o)
      for (let i = 0; i < inputs; ++i) layer.weight[i * padded + o] = fromHalf(half[next++]);
    for (let o = 0; o < outputs; ++o) layer.bias[o] = fromHalf(half[next++]);
    return layer;
  });
}

// The layers as uniform blocks of 4 x 4 matrices, column by column, and one of biases.
function buffersOf(graphics, layers) {
  const bias = new Float32Array(96 * 4), blocks = layers.map(({inputs, outputs, weight, bias: own}, l) => {
    const across = Math.ceil(inputs / 4), block = new Float32Array(4 * across * outputs);
    for (let i = 0; i < inputs; ++i)
      for (let o = 0; o < outputs; ++o)
        block[16 * ((o >> 2) * across + (i >> 2)) + 4 * (i & 3) + (o & 3)] = weight[i * outputs + o];
    bias.set(own, 64 * l);
    return block;
  });
  return [...blocks, bias].map((data) => graphics.buffer(data, graphics.gl.UNIFORM_BUFFER));
}

// Numbers of the page's splats, `words` a splat, in whole rows of texels.
function inRows(scene, data, words) {
  if (data.length !== words * scene.count) throw new PageError('the style that came has another number of splats');
  const into = new Uint32Array(words * WIDTH * scene.source.color.height);
  into.set(data);
  return into;
}

// Colours of a style, to draw the scene with; `codes`: the words of its splats, if they are known.
async function styleColors(graphics, scene, style, id, progress, codes = null) {
  const gl = graphics.gl;
  const layers = await loadWeights(id), buffers = buffersOf(graphics, layers);
  const names = ['Layer0', 'Layer1', 'Layer2', 'Layer3', 'Layer4', 'Layer5', 'Biases'];
  const {source} = scene, {height} = source.color;
  const colors = {code: checkCode(style.color, id), background: style.background};
  const residual = style.residual && !codes
      ? inRows(scene, await unpackResidual(textOf(id.replace('network', 'residual')), id.replace('network', 'residual'),
                                                  style.residual, await asNumbers(scene.kept.earlier)), 2) : null;
  colors.color = codes ? graphics.texture('u4', inRows(scene, new Uint32Array(codes.buffer), 4)) : graphics.blank('u4', height);
  const framebuffer = gl.createFramebuffer();
  const place = codes ? null : await asWords(scene.kept.place);
  // Of what goes with the splats no more than a strip is on the graphics processor.
  const beside = [['uPlace', place], ['uResidual', residual]].map(([name, data]) => ({name, data, texture: data && graphics.blank('u2', STRIP)}));

  // False if it would take long and `mayLeave` is set.
  async function pass(mayLeave) {
    const p = graphics.network ??= check(gl, compile(gl, [[gl.VERTEX_SHADER, EVERY_PIXEL], [gl.FRAGMENT_SHADER, withCode(NETWORK_GLSL)]]));
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, colors.color.texture, 0);
    let second = 0;
    for (let y = 0, rows = 1, strips = 0; y < height; ++strips) {
      const begun = performance.now();
      // The first strip compiles; the second says how long all would take.
      if (strips === 2 && mayLeave && (begun - second) * height / 1000 > (scene.coarse ? 1 : 5)) return false;
      if (strips === 1) second = begun;
      gl.useProgram(p.program);
      gl.bindVertexArray(graphics.array);
      buffers.forEach((buffer, i) => {
        gl.uniformBlockBinding(p.program, gl.getUniformBlockIndex(p.program, names[i]), i);
        gl.bindBufferBase(gl.UNIFORM_BUFFER, i, buffer.buffer);
      });
      beside.forEach(({name, data, texture}, i) => {
        if (data) graphics.write(texture, data.subarray(2 * WIDTH * y, 2 * WIDTH * (y + rows)));
        graphics.bind(p, name, 1 + i, texture ?? graphics.empty.p);
      });
      graphics.bind(p, 'uColor', 0, source.color);
      gl.uniform3fv(p.at('uResidualScale'), style.residual?.scale ?? [0, 0, 0]);
      gl.uniform1i(p.at('uHasResidual'), residual ? 1 : 0);
      gl.uniform1i(p.at('uRow'), y);
      graphics.setCodes(p, [source.code, colors.code]);
      gl.uniform3fv(p.at('uPosition'), scene.positionUnit);
      gl.uniform3fv(p.at('uConstant'), style.constant);
      gl.uniformMatrix3fv(p.at('uBase'), true, style.base);
      gl.uniform1f(p.at('uOmega'), style.omega);
      gl.uniform1f(p.at('uPositionScale'), style.position_scale);
      gl.uniform1f(p.at('uShift'), scene.shift);
      gl.uniform1i(p.at('uActivation'), style.activation);
      gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
      gl.viewport(0, 0, WIDTH, height);
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(0, y, WIDTH, rows);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      gl.disable(gl.SCISSOR_TEST);
      gl.finish();
      gl.readBuffer(gl.COLOR_ATTACHMENT0);
      gl.readPixels(0, y, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, new Uint32Array(4));
      y += rows;
      progress(Math.min(1, y / height));
      const took = performance.now() - begun;
      if (strips > 0) rows = Math.max(1, Math.min(STRIP, took < 40 ? 2 * rows : took > 120 ? rows >> 1 : rows));
      await wait();
    }
    return true;
  }
  const fast = !codes && (graphics.onCores !== true || !workersRun) && await pass(workersRun);
  if (!codes && !scene.coarse) graphics.onCores = !fast;
  if (!codes && !fast) await restyleOnCores(graphics, scene, style, layers, {place, residual}, colors, progress);
  gl.deleteFramebuffer(framebuffer);
  beside.forEach(({texture}) => texture && graphics.free(texture));
  buffers.forEach((buffer) => graphics.freeBuffer(buffer));
  return colors;
}
