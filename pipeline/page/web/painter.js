// Keeps the canvas painted: coarse while something changes, then strip by strip at full size.

class Painter {
  constructor(canvas, graphics, scene, pictureOf) {
    Object.assign(this, {canvas, graphics, scene, pictureOf});
    this.part = 0.5;        // of the canvas's side while moving
    this.rows = 16;         // of a strip
    this.changed = true;
    this.next = 0;          // row of the full picture
    this.frameTime = 0;
    this.shown = null;      // the scene whose picture is on the canvas
    this.resize();
  }
  take(scene) {
    this.scene = scene;
    this.change();
  }
  resize() {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (this.full && this.full.width === width && this.full.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.full?.free();
    this.full = this.graphics.target(width, height);
    this.change();
  }
  change() {
    this.changed = true;
    this.next = 0;
  }
  // The rectangles of a picture and the styles in each.
  draw(target, strip) {
    const {view, parts} = this.pictureOf(target.width, target.height);
    for (const {from, to, sets, map} of parts) {
      const x = Math.round(from * target.width), end = Math.round(to * target.width);
      if (end > x)
        this.scene.draw(view, sets, map, target, {x, y: strip.y, width: end - x, height: strip.height});
    }
  }
  // One step of work; false if there is none.
  step() {
    const begun = performance.now();
    // Splats are drawn in the last order that there is, until they are in that of the view.
    const order = this.scene.orderFor(this.pictureOf(this.full.width, this.full.height).view, () => this.change());
    if (!order.any) return true;
    if (this.changed) {
      this.changed = false;
      const width = Math.max(16, Math.round(this.full.width * this.part));
      const height = Math.max(16, Math.round(this.full.height * this.part));
      if (!this.coarse || this.coarse.width !== width || this.coarse.height !== height) {
        this.coarse?.free();
        this.coarse = this.graphics.target(width, height);
      }
      this.scene.few = this.scene.slow;
      this.draw(this.coarse, {y: 0, height});
      this.scene.few = false;
      this.graphics.settle(this.coarse);
      this.graphics.show(this.coarse, this.canvas, null);
      this.shown = this.scene;
      this.frameTime = performance.now() - begun;
      // Half of a frame of 60 Hz, smoothly.
      const wanted = Math.sqrt(14 / Math.max(this.frameTime, 1));
      // Splats cost as much in a small picture: where that is slow, a few of them are drawn.
      const least = 0.35;
      if (this.part === least && this.frameTime > 70) this.scene.slow = true;
      this.part = Math.max(least, Math.min(1, this.part * Math.max(0.7, Math.min(1.15, wanted))));
      this.rest = performance.now() + 120;
      return true;
    }
    if (this.next >= this.full.height) return false;
    if (begun < this.rest || !order.exact) return true;
    // Each strip costs a look at all splats.
    const height = Math.min(Math.max(this.rows, this.full.height >> 1), this.full.height - this.next);
    const strip = {y: this.full.height - this.next - height, height};  // from the top
    this.draw(this.full, strip);
    this.graphics.settle(this.full);
    this.graphics.show(this.full, this.canvas, strip);
    this.next += height;
    const took = performance.now() - begun;
    this.rows = Math.max(2, Math.min(512, took < 15 ? 2 * this.rows : took > 50 ? this.rows >> 1 : this.rows));
    return true;
  }
  get settled() { return !this.changed && this.next >= this.full.height; }
}
