// A style: its network's weights, and the pass that sends each voxel through it.

const LAYERS = [[30, 64], [64, 64], [64, 64], [64, 64], [64, 64], [64, 27]];

async function loadNetwork(gl, id) {
  const bytes = await bytesOf(id), half = new Uint16Array(bytes.buffer);
  const expected = LAYERS.reduce((sum, [i, o]) => sum + o * (i + 1), 0);
  if (half.length !== expected) throw new PageError('a part of the page is damaged: ' + id);
  const bias = new Float32Array(96 * 4), buffers = [];
  let next = 0;
  LAYERS.forEach(([inputs, outputs], layer) => {
    const across = Math.ceil(inputs / 4), down = Math.ceil(outputs / 4);
    const matrices = new Float32Array(16 * across * down);
    for (let o = 0; o < outputs; ++o)
      for (let i = 0; i < inputs; ++i)
        matrices[16 * ((o >> 2) * across + (i >> 2)) + 4 * (i & 3) + (o & 3)] = fromHalf(half[next++]);
    for (let o = 0; o < outputs; ++o) bias[64 * layer + o] = fromHalf(half[next++]);
    buffers.push(matrices);
  });
  buffers.push(bias);
  return buffers.map((data) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.UNIFORM_BUFFER, buffer);
    gl.bufferData(gl.UNIFORM_BUFFER, data, gl.STATIC_DRAW);
    return buffer;
  });
}

// Colours of a style, to draw the scene with.
async function styleColors(graphics, scene, style, id, progress) {
  const gl = graphics.gl;
  graphics.network ??= compile(gl, [[gl.VERTEX_SHADER, EVERY_PIXEL], [gl.FRAGMENT_SHADER, NETWORK_GLSL]]);
  const p = graphics.network, buffers = await loadNetwork(gl, id);
  const names = ['Layer0', 'Layer1', 'Layer2', 'Layer3', 'Layer4', 'Layer5', 'Biases'];
  const colors = {scale: style.scale, texelScale: style.sphere_scale ?? [1, 1, 1], background: style.background};
  colors.first = graphics.blank('u4', scene.source.first.height);
  colors.second = graphics.blank('u4', scene.source.first.height);
  const framebuffer = gl.createFramebuffer();

  async function pass(targets, height, onSpheres, from, scale, styledScale) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const attached = targets.map((t, i) => {
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, t?.texture ?? null, 0);
      return t ? gl.COLOR_ATTACHMENT0 + i : gl.NONE;
    });
    for (let y = 0, rows = 2; y < height;) {
      const begun = performance.now();
      gl.useProgram(p.program);
      gl.bindVertexArray(graphics.array);
      buffers.forEach((buffer, i) => {
        gl.uniformBlockBinding(p.program, gl.getUniformBlockIndex(p.program, names[i]), i);
        gl.bindBufferBase(gl.UNIFORM_BUFFER, i, buffer);
      });
      graphics.bind(p, 'uFirst', 0, from[0]);
      graphics.bind(p, 'uSecond', 1, from[1]);
      graphics.bind(p, 'uPlaceOfColumn', 2, scene.placeOfColumn ?? graphics.empty.i);
      gl.uniform1fv(p.at('uScale'), scale);
      gl.uniform1fv(p.at('uStyledScale'), styledScale);
      gl.uniform3fv(p.at('uPosition'), scene.positionUnit);
      gl.uniform3fv(p.at('uConstant'), style.constant);
      gl.uniformMatrix3fv(p.at('uBase'), true, style.base);
      gl.uniform1f(p.at('uOmega'), style.omega);
      gl.uniform1f(p.at('uPositionScale'), style.position_scale);
      gl.uniform1i(p.at('uActivation'), style.activation);
      gl.uniform1i(p.at('uOnSpheres'), onSpheres);
      gl.uniform1i(p.at('uLayers'), scene.header.spheres?.layers ?? 1);
      gl.uniform1i(p.at('uResolution'), scene.header.spheres?.resolution ?? 1);
      gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
      gl.drawBuffers(attached);
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
      rows = Math.max(1, Math.min(256, took < 40 ? 2 * rows : took > 120 ? rows >> 1 : rows));
      await wait();
    }
  }
  const {source} = scene;
  await pass([colors.first, colors.second], source.first.height, scene.header.finest === null ? 2 : 0,
             [source.first, source.second], source.scale, style.scale);
  if (source.texel) {
    colors.texel = graphics.blank('u2', source.texel.height);
    const scales = (three) => Float32Array.from({length: 27}, (_, i) => i < 3 ? three[i] : 1);
    await pass([colors.texel], source.texel.height, 1, [source.texel, source.texel],
               scales(source.texelScale), scales(colors.texelScale));
  }
  gl.deleteFramebuffer(framebuffer);
  buffers.forEach((buffer) => gl.deleteBuffer(buffer));
  return colors;
}
