// Textures, programs and pictures on the graphics processor.

const WIDTH = 2048;  // of all textures

// A program that may still be compiling; it must be checked before it draws.
function compile(gl, sources) {
  const program = gl.createProgram(), shaders = sources.map(([kind, source]) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    return shader;
  });
  gl.linkProgram(program);
  const place = {};
  return {program, shaders, at: (name) => place[name] ??= gl.getUniformLocation(program, name)};
}

function check(gl, made) {
  if (made.checked || gl.isContextLost()) return made;
  for (const shader of made.shaders)
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS))
      throw new PageError('the graphics processor refuses a program: ' + gl.getShaderInfoLog(shader));
  if (!gl.getProgramParameter(made.program, gl.LINK_STATUS))
    throw new PageError('the graphics processor refuses a program: ' + gl.getProgramInfoLog(made.program));
  made.checked = true;
  return made;
}

const EVERY_PIXEL = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;

const withCode = (text) => text.replace('//@code', codeGlsl());
const withColors = (text) => withCode(text.replace('//@colors', COLORS_GLSL));

class Graphics {
  constructor(gl) {
    this.gl = gl;
    this.bytes = this.most = 0;  // of all textures and buffers, now and so far
    this.made = 0;  // textures so far
    // Networks run on the cores where these draw, too; '#graphics' tests the others' way.
    const name = gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info')?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);
    if (location.hash === '#cores' || location.hash !== '#graphics' && /swiftshader|llvmpipe|software/i.test(name)) this.onCores = true;
    this.floats = !!(gl.getExtension('EXT_color_buffer_float') || gl.getExtension('EXT_color_buffer_half_float'));
    this.empty = {u: this.texture('u4', new Uint32Array(4)), p: this.texture('u2', new Uint32Array(2))};
    this.array = gl.createVertexArray();
  }
  // 2048 texels a row, zeros; kinds: u4, u2, i1 are unsigned and signed integers of 32 bits.
  blank(kind, height) {
    const gl = this.gl;
    if (height > gl.getParameter(gl.MAX_TEXTURE_SIZE))
      throw new PageError('this scene has more splats than this graphics processor can hold');
    const inside = {u4: gl.RGBA32UI, u2: gl.RG32UI, i1: gl.R32I}[kind], texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, inside, WIDTH, height);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    return this.taken({texture, height, kind, number: ++this.made, bytes: WIDTH * height * 4 * Number(kind[1])});
  }
  texture(kind, data) {
    const texels = data.length / Number(kind[1]);
    const made = this.blank(kind, Math.max(1, Math.ceil(texels / WIDTH)));
    this.write(made, data);
    return made;
  }
  // Into its first rows.
  write({texture, kind}, data) {
    const gl = this.gl, channels = Number(kind[1]), texels = data.length / channels;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const [format, type] = {u4: [gl.RGBA_INTEGER, gl.UNSIGNED_INT], u2: [gl.RG_INTEGER, gl.UNSIGNED_INT],
                            i1: [gl.RED_INTEGER, gl.INT]}[kind];
    const whole = Math.floor(texels / WIDTH), rest = texels % WIDTH;
    if (whole) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, whole, format, type, data, 0);
    if (rest) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, whole, rest, 1, format, type, data, whole * WIDTH * channels);
  }
  taken(thing) {
    this.bytes += thing.bytes;
    this.most = Math.max(this.most, this.bytes);
    return thing;
  }
  free(texture) {
    this.gl.deleteTexture(texture.texture);
    this.bytes -= texture.bytes;
  }
  buffer(data, kind) {
    const gl = this.gl, buffer = gl.createBuffer();
    gl.bindBuffer(kind, buffer);
    gl.bufferData(kind, data, gl.STATIC_DRAW);
    return this.taken({buffer, bytes: data.byteLength});
  }
  freeBuffer(buffer) {
    this.gl.deleteBuffer(buffer.buffer);
    this.bytes -= buffer.bytes;
  }
  bind(program, name, unit, texture) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, texture.texture);
    gl.uniform1i(program.at(name), unit);
  }

  setCodes(program, codes) {
    const gl = this.gl;
    gl.uniformMatrix3fv(program.at('uOpponent'), false, codes.flatMap((c) => c.opponent));
    gl.uniform3fv(program.at('uHarmonics'), codes.flatMap((c) => c.harmonics));
    gl.uniform3fv(program.at('uStepOf'), codes.flatMap(stepsInOrder));
    gl.uniform4iv(program.at('uBits'), codes.flatMap(bitsInOrder));
  }

  // What colors.glsl needs; the colour of the background. `sets`: {weight, colors} of at most three.
  setColors(p, sets, map) {
    const gl = this.gl, weight = [0, 0, 0], background = [0, 0, 0];
    for (let i = 0; i < 3; ++i) {
      const set = sets[i];
      this.bind(p, 'uColor' + i, 3 + i, set?.colors.color ?? this.empty.u);
      if (!set) continue;
      weight[i] = set.weight;
      for (let c = 0; c < 3; ++c) background[c] += set.weight * set.colors.background[c];
    }
    if (map) {
      const flat = background.slice();
      for (let c = 0; c < 3; ++c)
        background[c] = Math.max(0, dot(map.matrix.slice(3 * c, 3 * c + 3), flat) + map.offset[c]);
    }
    this.setCodes(p, Array.from({length: p.sets}, (_, i) => (sets[i] ?? sets[0]).colors.code));
    gl.uniform3fv(p.at('uWeight'), weight);
    gl.uniformMatrix3fv(p.at('uMap'), true, map?.matrix ?? [1, 0, 0, 0, 1, 0, 0, 0, 1]);
    gl.uniform3fv(p.at('uOffset'), map?.offset ?? [0, 0, 0]);
    return background;
  }
  setView(p, view, width, height) {
    const gl = this.gl;
    gl.uniformMatrix3fv(p.at('uWorldFromCamera'), true, view.rotation);
    gl.uniform3fv(p.at('uEye'), view.eye);
    gl.uniform4fv(p.at('uLens'), view.lens);
    gl.uniform2f(p.at('uSize'), width, height);
  }

  // A picture of RGBA8 to draw into.
  target(width, height, format = this.gl.RGBA8) {
    const gl = this.gl, texture = gl.createTexture(), framebuffer = gl.createFramebuffer();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    const made = this.taken({texture, framebuffer, width, height, bytes: (format === gl.RGBA8 ? 4 : 8) * width * height, free: () => {
      gl.deleteFramebuffer(framebuffer);
      this.free(made);
      made.sum?.free();
    }});
    return made;
  }
  // Of a picture's size, to sum what is blended: half floats, or the picture itself, which rounds each sum, where there are none.
  sumOf(target) { return this.floats ? target.sum ??= this.target(target.width, target.height, this.gl.RGBA16F) : target; }
  // All of a picture, stretched, or the rows of a strip of one of the canvas's size.
  show(target, canvas, strip) {
    const gl = this.gl, [low, high] = strip ? [strip.y, strip.y + strip.height] : [0, target.height];
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, target.framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, low, target.width, high, 0, strip ? low : 0, canvas.width,
                       strip ? high : canvas.height, gl.COLOR_BUFFER_BIT, gl.LINEAR);
  }
  // Waits for what was drawn.
  settle(target) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
  read(target) {
    const gl = this.gl, pixels = new Uint8Array(4 * target.width * target.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.readPixels(0, 0, target.width, target.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return pixels;
  }
}
