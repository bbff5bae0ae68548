// Splats in the order of their depth, back to front, sorted by a worker where there are workers.

// What a worker runs; it must not use anything outside itself. `points` [n, 3]. Depths are rounded to floats, whose bits sort as
// they do, in three passes of 11 bits; of equal ones the last comes first.
function depthSorter(points) {
  const n = points.length / 3, depth = new Float32Array(n), key = new Uint32Array(depth.buffer), count = new Uint32Array(2048);
  let from = new Int32Array(n), to = new Int32Array(n);
  return ([x, y, z], along, near) => {
    let seen = 0;
    for (let i = 0; i < n; ++i) {
      const at = x * points[3 * i] + y * points[3 * i + 1] + z * points[3 * i + 2] - along;
      if (!(at >= near)) continue;
      depth[i] = at;
      from[seen++] = i;
    }
    for (let shift = 0; shift < 33; shift += 11) {
      count.fill(0);
      for (let i = 0; i < seen; ++i) ++count[key[from[i]] >>> shift & 2047];
      for (let k = 0, sum = 0; k < 2048; ++k) [count[k], sum] = [sum, sum + count[k]];
      for (let i = 0; i < seen; ++i) to[count[key[from[i]] >>> shift & 2047]++] = from[i];
      [from, to] = [to, from];
    }
    return from.slice(0, seen).reverse();
  };
}

class DepthOrder {
  constructor(points) {
    this.waiting = [];
    const text = `'use strict';${depthSorter};let sort;onmessage=({data})=>{if(data.points)sort=depthSorter(data.points);` +
        'else{const order=sort(...data);postMessage(order,[order.buffer])}}';
    const here = () => {
      this.sort = depthSorter(points);
      this.worker = null;
      this.waiting.splice(0).forEach(({task, done}) => done(this.sort(...task)));
    };
    if (!workersRun) return void here();
    const url = URL.createObjectURL(new Blob([text], {type: 'text/javascript'}));
    try {
      this.worker = new Worker(url);
      this.worker.onerror = (event) => {
        event.preventDefault();
        here();
      };
      this.worker.onmessage = ({data}) => this.waiting.shift().done(data);
      this.worker.postMessage({points});
    } catch (error) {
      here();
    } finally {
      URL.revokeObjectURL(url);
    }
  }
  // A promise of the splats beyond the near plane as the view sees them.
  of({rotation, eye}, near) {
    const forward = [rotation[2], rotation[5], rotation[8]], task = [forward, dot(forward, eye), near];
    if (!this.worker) return Promise.resolve(this.sort(...task));
    this.worker.postMessage(task);
    return new Promise((done) => this.waiting.push({task, done}));
  }
  end() { this.worker?.terminate(); }
}
