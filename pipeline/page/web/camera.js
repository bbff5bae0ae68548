// Where the page looks from: orbit and flight, within a fence around the photos' places.

const add = (a, b, s = 1) => a.map((v, i) => v + s * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.hypot(...a);
const unit = (a) => a.map((v) => v / (norm(a) || 1));
function turned(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle), along = dot(v, axis) * (1 - c), side = cross(axis, v);
  return v.map((x, i) => x * c + side[i] * s + axis[i] * along);
}

// The point nearest to the photos' axes, or null where these are almost parallel.
function pointOfViews(cameras) {
  const m = [0, 0, 0, 0, 0, 0, 0, 0, 0], right = [0, 0, 0];
  for (const {eye, forward} of cameras)
    for (let i = 0; i < 3; ++i)
      for (let j = 0; j < 3; ++j) {
        const p = (i === j) - forward[i] * forward[j];
        m[3 * i + j] += p / cameras.length;
        right[i] += p * eye[j] / cameras.length;
      }
  const row = (i) => m.slice(3 * i, 3 * i + 3), det = dot(row(0), cross(row(1), row(2)));
  if (det < 0.01) return null;
  const solve = (k) => {
    const rows = [0, 1, 2].map((i) => row(i).map((v, j) => j === k ? right[i] : v));
    return dot(rows[0], cross(rows[1], rows[2])) / det;
  };
  return [solve(0), solve(1), solve(2)];
}

class View {
  constructor(header) {
    this.photos = header.cameras.map((c) => ({
      eye: c.center, forward: c.rotation.slice(6), up: c.rotation.slice(3, 6).map((v) => -v),
      half: [0.5 * c.width / c.fx, 0.5 * c.height / c.fy]}));
    this.up = header.up;
    const home = this.photos[header.home], all = this.photos;
    const low = [0, 1, 2].map((a) => Math.min(...all.map((p) => p.eye[a])));
    const high = [0, 1, 2].map((a) => Math.max(...all.map((p) => p.eye[a])));
    this.size = norm(add(high, low, -1)) || 1;
    this.fence = [low.map((v) => v - 0.25 * this.size), high.map((v) => v + 0.25 * this.size)];
    const seen = pointOfViews(all);
    this.pivotOfHome = seen && dot(add(seen, home.eye, -1), home.forward) > 0
        ? seen : add(home.eye, home.forward, this.size);
    this.mode = 'orbit';
    this.go(home);
    this.pivot = this.pivotOfHome;
  }
  go(photo) {
    this.eye = photo.eye.slice();
    this.forward = unit(photo.forward);
    this.top = unit(photo.up);
    this.half = photo.half.slice();
    // The pivot stays on the axis of the view, as far away as the scene's.
    const distance = Math.max(0.05 * this.size, dot(add(this.pivotOfHome, this.eye, -1), this.forward));
    this.pivot = add(this.eye, this.forward, distance);
  }
  inFence() {
    this.eye = this.eye.map((v, a) => Math.max(this.fence[0][a], Math.min(this.fence[1][a], v)));
  }
  // Angles in radians: around the pivot, or about the eye itself.
  turn(right, down) {
    const side = unit(cross(this.forward, this.up)), pitch = Math.acos(Math.max(-1, Math.min(1, dot(this.forward, this.up))));
    const steep = Math.max(0.1 - pitch, Math.min(Math.PI - 0.1 - pitch, down));
    const apply = (v) => turned(turned(v, side, -steep), this.up, -right);
    if (this.mode === 'orbit') {
      const before = this.eye;
      this.eye = add(this.pivot, apply(add(this.eye, this.pivot, -1)));
      this.inFence();
      if (norm(add(this.eye, before, -1)) === 0) return;
      const ahead = apply(this.forward);
      this.forward = unit(ahead);
    } else {
      this.forward = unit(apply(this.forward));
    }
    this.top = unit(apply(this.top));
    this.level();
  }
  // The horizon comes back to level as the view turns.
  level() {
    const side = unit(cross(this.forward, this.up)), top = cross(side, this.forward);
    this.top = unit(add(this.top, top, 0.25));
    this.top = unit(add(this.top, this.forward, -dot(this.top, this.forward)));
  }
  // In units of the scene's size: to the right, upwards, ahead.
  move(right, upwards, ahead) {
    const side = cross(this.forward, this.top), from = this.eye;
    this.eye = add(add(add(this.eye, side, right * this.size), this.top, upwards * this.size),
                   this.forward, ahead * this.size);
    this.inFence();
    if (this.mode === 'fly' || right !== 0 || upwards !== 0) this.pivot = add(this.pivot, add(this.eye, from, -1));
  }
  // Towards the pivot by a part of the way.
  approach(part) {
    const way = add(this.pivot, this.eye, -1), distance = norm(way);
    if (distance * (1 - part) < 0.02 * this.size && part > 0) return;
    this.eye = add(this.eye, way, part);
    this.inFence();
  }
  // For a picture of width x height: between the whole photo and one that fills it.
  at(width, height, exact = null) {
    const side = unit(cross(this.forward, this.top)), down = cross(this.forward, side);
    const rotation = [side[0], down[0], this.forward[0], side[1], down[1], this.forward[1],
                      side[2], down[2], this.forward[2]];
    const wide = width / (2 * this.half[0]), high = height / (2 * this.half[1]);
    const focal = Math.sqrt(wide * high);
    return {rotation, eye: this.eye, lens: exact ?? [focal, focal, width / 2, height / 2]};
  }
  // For a window, which may be a phone's held upright: the photo's whole width is seen in it, so that nothing is cut off at the sides.
  inWindow(width, height) {
    const at = this.at(width, height), focal = Math.min(at.lens[0], width / (2 * this.half[0]));
    return {...at, lens: [focal, focal, width / 2, height / 2]};
  }
  // For keyframes.
  save() { return {eye: this.eye.slice(), forward: this.forward.slice(), up: this.top.slice(), half: this.half.slice()}; }
}
