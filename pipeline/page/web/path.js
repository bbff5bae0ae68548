// Keyframes of a film: places and weights of styles. Format and interpolation are those of
// pipeline/page/keyframes.h.

const spline = (a, b, c, d, t) =>
    b.map((_, i) => b[i] + 0.5 * t * (c[i] - a[i] + t * (2 * a[i] - 5 * b[i] + 4 * c[i] - d[i] +
                                                        t * (3 * (b[i] - c[i]) + d[i] - a[i]))));

class CameraPath {
  constructor() {
    this.keyframes = [];
    this.fps = 30;
  }
  get seconds() { return this.keyframes.length ? this.keyframes[this.keyframes.length - 1].time : 0; }
  add(place, weights) {
    this.keyframes.push({time: this.keyframes.length ? this.seconds + 2 : 0, ...place, weights});
  }
  remove(i) {
    this.keyframes.splice(i, 1);
    const first = this.keyframes[0]?.time ?? 0;
    for (const key of this.keyframes) key.time -= first;
  }
  at(seconds) {
    const keys = this.keyframes, last = keys.length - 1;
    let i = 0;
    while (i < last - 1 && keys[i + 1].time <= seconds) ++i;
    const j = Math.min(i + 1, last), length = keys[j].time - keys[i].time;
    const t = length > 0 ? Math.max(0, Math.min(1, (seconds - keys[i].time) / length)) : 0;
    const four = [keys[Math.max(i - 1, 0)], keys[i], keys[j], keys[Math.min(j + 1, last)]];
    const of = (name) => spline(...four.map((key) => key[name]), t);
    const between = (name) => keys[i][name].map((v, k) => (1 - t) * v + t * keys[j][name][k]);
    let forward = unit(of('forward')), up = unit(of('up'));
    if (!(norm(cross(forward, up)) > 1e-6)) [forward, up] = [keys[i].forward, keys[i].up];
    return {eye: of('eye'), forward, up, half: between('half'), weights: between('weights')};
  }
  text(styles) {
    const round = (v) => v.map((x) => Number(x.toPrecision(8)));
    return JSON.stringify({
      format: 'regrade camera path', version: 1, frames_per_second: this.fps, styles,
      keyframes: this.keyframes.map((k) => ({
        time: k.time, eye: round(k.eye), forward: round(k.forward), up: round(k.up),
        half_width: k.half[0], half_height: k.half[1], weights: round(k.weights)}))}, null, 1) + '\n';
  }
  // `styles`: the page's, by their ids.
  read(text, styles) {
    let json = null;
    try { json = JSON.parse(text); } catch (error) { /* said below */ }
    const three = (v) => Array.isArray(v) && v.length === 3 && v.every(Number.isFinite);
    if (json?.format !== 'regrade camera path' || json.version !== 1 || !Array.isArray(json.keyframes) ||
        json.keyframes.length > 1000 || !Array.isArray(json.styles) || json.styles.length > 16)
      throw new PageError('this file is no camera path');
    const place = json.styles.map((id) => styles.indexOf(id));
    let time = -1;
    const keys = json.keyframes.map((k) => {
      if (!three(k.eye) || !three(k.forward) || !three(k.up) || !(k.half_width > 0) ||
          !(k.half_height > 0) || !(k.time > time) || !Array.isArray(k.weights) || k.weights.length !== place.length ||
          !k.weights.every((w) => w >= 0 && w <= 1) || k.weights.reduce((sum, w) => sum + w, 0) > 1 + 1e-6 ||
          !(norm(cross(unit(k.forward), unit(k.up))) > 1e-6))
        throw new PageError('a keyframe of this camera path is damaged');
      time = k.time;
      const weights = styles.map(() => 0);
      k.weights.forEach((w, i) => {
        if (place[i] >= 0) weights[place[i]] = w;
        else if (w > 0) throw new PageError('this camera path has a style that is not in this page');
      });
      return {time, eye: k.eye, forward: unit(k.forward), up: unit(k.up), half: [k.half_width, k.half_height], weights};
    });
    this.keyframes = keys;
    if (json.frames_per_second >= 1 && json.frames_per_second <= 240) this.fps = json.frames_per_second;
  }
}
