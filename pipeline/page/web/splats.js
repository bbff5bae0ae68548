// A scene of splats on the graphics processor: seen once for each view, and blended back to front.

const QUADS = 1024;  // of an instance, since software draws instances one by one; blend_splats.glsl's, too

const RESOLVE = `#version 300 es
precision highp float;
uniform sampler2D uPicture;
out vec4 color;
void main() { color = vec4(clamp(texelFetch(uPicture, ivec2(gl_FragCoord.xy), 0).rgb, 0.0, 1.0), 1.0); }`;

function splatPrograms(graphics, count) {
  const gl = graphics.gl, sets = count > 1 ? 3 : 1, made = graphics.splatPrograms ??= {see: {}};
  if (!made.blend) {
    const [vertex, fragment] = BLEND_GLSL.split('//@fragment\n');
    made.blend = compile(gl, [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]);
    made.resolve = compile(gl, [[gl.VERTEX_SHADER, EVERY_PIXEL], [gl.FRAGMENT_SHADER, RESOLVE]]);
  }
  const see = made.see[sets] ??= {sets, ...compile(gl, [
    [gl.VERTEX_SHADER, EVERY_PIXEL], [gl.FRAGMENT_SHADER, withColors(SEE_GLSL).replace('\n', `\n#define SETS ${sets}\n`)]])};
  return {...made, see};
}

class SplatScene {
  // `made`: see decodeField; its large parts are taken. Without points it cannot be drawn.
  constructor(header, made, graphics) {
    const {count, positionUnit, shift} = made, {gl} = graphics;
    Object.assign(this, {header, count, positionUnit, shift, graphics});
    this.mean = graphics.texture('u4', made.mean);
    this.shape = graphics.texture('u4', made.shape);
    this.color = graphics.texture('u4', made.color);
    this.seen = [graphics.blank('u4', this.mean.height), graphics.blank('u4', this.mean.height)];
    this.source = {color: this.color, code: header.color, background: header.background};
    this.kept = {place: new Blob([made.place]), earlier: new Blob([made.earlier])};
    // A texture is read when all that was drawn before is done.
    if (graphics.onCores) this.kept.color = new Blob([made.color]);
    if (made.points) this.sorter = new DepthOrder(made.points);
    this.order = graphics.blank('i1', this.mean.height);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    const corners = Uint16Array.from({length: 6 * QUADS}, (_, i) => 4 * Math.floor(i / 6) + [0, 1, 2, 2, 1, 3][i % 6]);
    this.corners = graphics.buffer(corners, gl.ELEMENT_ARRAY_BUFFER);
    this.framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    this.seen.forEach(({texture}, i) => gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0));
    gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
  }
  get parts() { return [this.mean, this.shape, this.color, ...this.seen, this.order]; }
  free() {
    const gl = this.graphics.gl;
    this.sorter?.end();
    this.parts.forEach((texture) => this.graphics.free(texture));
    this.graphics.freeBuffer(this.corners);
    gl.deleteVertexArray(this.array);
    gl.deleteFramebuffer(this.framebuffer);
  }
  // Begins to prepare the programs for `count` sets, which takes a while: draws nothing.
  static warm(header, graphics, count) {
    const none = new Uint32Array(4), made = {count: 1, mean: none, shape: none, color: none, place: none, earlier: none};
    const scene = new SplatScene(header, made, graphics), target = graphics.target(1, 1);
    const sets = Array.from({length: count}, () => ({weight: 1, colors: scene.source}));
    scene.draw({rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], eye: [0, 0, 0], lens: [1, 1, 0.5, 0.5]}, sets, null, target,
               {x: 0, y: 0, width: 1, height: 1});
    graphics.gl.flush();
    target.free();
    scene.free();
  }
  // A promise: until something else is awaited, what is drawn next is in the order of this view.
  async arrange(view) {
    const order = await this.sorter.of(view, this.header.splats.near_plane);
    this.graphics.write(this.order, order);
    this.ordered = {count: order.length, view: JSON.stringify([view.rotation, view.eye])};
  }
  // Whether there is an order, and whether it is this view's; if not, it will be, and `then` is called.
  orderFor(view, then) {
    const exact = this.ordered?.view === JSON.stringify([view.rotation, view.eye]);
    if (!exact && !this.arranging) {
      this.arranging = true;
      this.arrange(view).then(() => {
        this.arranging = false;
        then();
      });
    }
    return {any: !!this.ordered, exact};
  }
  see(p, view, sets, map, {width, height}) {
    const {gl} = this.graphics, {splats} = this.header, u = (name) => p.at(name);
    gl.useProgram(p.program);
    gl.bindVertexArray(this.graphics.array);
    this.graphics.bind(p, 'uMean', 0, this.mean);
    this.graphics.bind(p, 'uShape', 1, this.shape);
    const background = this.graphics.setColors(p, sets, map);
    // The strips of a picture share what is seen.
    const key = JSON.stringify([view, width, height, map, sets.map((set) => [set.weight, set.colors.color.number])]);
    if (key === this.seenAs) return background;
    this.seenAs = key;
    this.graphics.setView(p, view, width, height);
    gl.uniform1f(u('uNearPlane'), splats.near_plane);
    const larger = splats.fit_pixel < 0 ? 1 : view.lens[0] * view.lens[1] * splats.fit_pixel ** 2;
    gl.uniform2f(u('uBlur'), splats.blur * Math.max(1, larger), splats.blur * Math.min(1, larger));
    gl.uniform1f(u('uScaleStep'), splats.scale_step);
    gl.uniform1f(u('uRotationStep'), splats.rotation_step);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.viewport(0, 0, WIDTH, this.mean.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    return background;
  }
  // In the order that they are in. `sets`: see Graphics.setColors; `view`: see camera.js. `few`: the splats that come first alone.
  draw(view, sets, map, target, strip) {
    const {gl} = this.graphics, programs = splatPrograms(this.graphics, sets.length), {blend, resolve} = programs;
    for (const program of [programs.see, blend, resolve]) check(gl, program);
    const background = this.see(programs.see, view, sets, map, target), sum = this.graphics.sumOf(target);
    gl.useProgram(blend.program);
    gl.bindVertexArray(this.array);
    this.seen.forEach((texture, i) => this.graphics.bind(blend, ['uPlace', 'uLight'][i], i, texture));
    this.graphics.bind(blend, 'uOrder', 2, this.order);
    const count = this.ordered?.count ?? 0;
    gl.uniform1i(blend.at('uCount'), count);
    gl.uniform1i(blend.at('uMost'), (this.few && this.header.splats.coarse) || this.count);
    const top = target.height - strip.y - strip.height;
    gl.uniform2f(blend.at('uSize'), target.width, target.height);
    gl.uniform4f(blend.at('uStrip'), strip.x, strip.x + strip.width, top, top + strip.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, sum.framebuffer);
    gl.viewport(0, 0, target.width, target.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(strip.x, strip.y, strip.width, strip.height);
    gl.clearBufferfv(gl.COLOR, 0, [...background, 1]);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.drawElementsInstanced(gl.TRIANGLES, 6 * QUADS, gl.UNSIGNED_SHORT, 0, Math.max(1, Math.ceil(count / QUADS)));
    gl.disable(gl.BLEND);
    if (sum !== target) {
      gl.useProgram(resolve.program);
      gl.bindVertexArray(this.graphics.array);
      this.graphics.bind(resolve, 'uPicture', 0, sum);
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    gl.disable(gl.SCISSOR_TEST);
  }
}
