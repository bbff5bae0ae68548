// The styles of a scene: the colours that each gives it, made when the style is first wanted.

class SceneStyles {
  // `scene`: a promise, of null where it will not come; `header`: the page's, whose styles may become more.
  constructor(graphics, scene, header) {
    Object.assign(this, {graphics, scene, header, colors: [], loading: []});
  }
  // `codes`: see styleColors. A coarse scene has not all splats to which a style could add: it shows what the network alone
  // makes of it, or nothing where the style is for an object.
  async make(i, progress, codes) {
    const scene = await this.scene, style = this.header.styles[i];
    if (!scene || scene.coarse && style.residual?.weight) return;
    this.colors[i] = await styleColors(this.graphics, scene, scene.coarse ? {...style, residual: null} : style, 'network_' + i, progress, codes);
  }
  free(set) {
    if (set) this.graphics.free(set.color);
  }
  forget(i) {
    this.free(this.colors[i]);
    this.colors[i] = this.loading[i] = null;
  }
  async end() {
    await Promise.allSettled(this.loading);
    this.colors.forEach((set) => this.free(set));
  }
}
