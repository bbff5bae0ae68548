// The splats of a page as the textures that hold them, see pipeline/page/field_codec.h; runs in a worker, or where there are none
// in slices.

// Each is predicted from up to three before it, of its own part.
function earlierOf(count, begin = 0) {
  const earlier = new Int32Array(3 * count).fill(-1);
  for (let i = 0; i < count; ++i)
    for (let k = 0, first = i < begin ? 0 : begin; k < 3 && i - k > first; ++k) earlier[3 * i + k] = i - k - 1;
  return earlier;
}

// `text`: shape and color of the first part, or of both. Calls progress(part). -> textures mean: the mean, ln o; shape: three scales and the
// quaternion's last three components, numbers of 16 bits; color; and the means alone, to sort
async function decodeField(header, text, progress) {
  const {basis, splats, center, radius} = header, {coarse} = splats, parts = text.shape.length;
  checkCode(header.color, 'color');
  const n = parts === 1 ? coarse : splats.count, ranges = [[0, coarse], [coarse, n]].slice(0, parts).filter(([a, b]) => b > a);
  const number = Array.from({length: 10}, () => new Int16Array(n)), earlier = ranges.map(([a, b]) => earlierOf(b - a));
  const ofPart = ([begin]) => begin === 0 && coarse > 0 ? 0 : 1;
  for (let r = 0; r < ranges.length; ++r) {
    const [begin, end] = ranges[r];
    await eachChannel(text.shape[ofPart(ranges[r])], 'shape', end - begin, 10, (k, bytes) =>
      channelNumbers(bytes, earlier[r], number[k].subarray(begin, end)));
    await progress(0.2 * (r + 1));
  }
  const made = {count: n, points: new Float32Array(3 * n), mean: new Uint32Array(4 * n), shape: new Uint32Array(4 * n),
                color: new Uint32Array(4 * n), place: new Uint32Array(2 * n)};
  const mean = new Float32Array(made.mean.buffer), most = Math.round(2 / splats.position_step), p = [0, 0, 0];
  for (let i = 0; i < n; ++i) {
    let farthest = 0, squared = 0;
    for (let a = 0; a < 3; ++a) {
      p[a] = number[a][i] * splats.position_step;
      farthest = Math.max(farthest, Math.abs(p[a]));
      squared += (number[6 + a][i] * splats.rotation_step) ** 2;
    }
    const opacity = number[9][i] * splats.opacity_step, grown = farthest <= 1 ? 1 : 1 / (2 - farthest) / farthest;
    if (!(squared < 1 && opacity > 0 && opacity < 1 && farthest < 2)) throw damaged('shape');
    for (let a = 0; a < 3; ++a) made.points[3 * i + a] = mean[4 * i + a] = center[a] + radius[a] * p[a] * grown;
    mean[4 * i + 3] = Math.log(opacity);
    const pair = (a, b) => number[a][i] & 65535 | number[b][i] << 16;
    made.shape.set([pair(3, 4), pair(5, 6), pair(7, 8), 0], 4 * i);
    made.place[2 * i] = number[0][i] + most | number[1][i] + most << 16;
    made.place[2 * i + 1] = number[2][i] + most;
  }
  await progress(0.5);
  const channel = new Int16Array(n), where = placesOfNumbers(header.color.bits);
  for (let r = 0; r < ranges.length; ++r) {
    const [begin, end] = ranges[r], own = channel.subarray(begin, end);
    await eachChannel(text.color[ofPart(ranges[r])], 'color', end - begin, 3 * basis, async (k, bytes) => {
      channelNumbers(bytes, earlier[r], own);
      const {word, above, unused} = where[9 * Math.floor(k / basis) + k % basis];
      for (let i = begin, at = 4 * begin + word; i < end; ++i, at += 4) made.color[at] |= channel[i] << unused >>> above;
      await progress(0.5 + 0.48 * (r + (k + 1) / (3 * basis)) / ranges.length);
    });
  }
  // A place is its number and `most`; a network's input is (place + shift) unit - 1.
  made.positionUnit = [splats.position_step, splats.position_step, splats.position_step];
  made.shift = 1 / splats.position_step - most;
  made.earlier = header.residuals ? earlierOf(n, coarse) : new Int32Array(0);
  return made;
}

// In a worker: a field for each message.
function serveDecoder() {
  onmessage = async ({data}) => {
    try {
      const made = await decodeField(data.header, data.text, (part) => postMessage({part}));
      postMessage({made}, Object.values(made).filter(ArrayBuffer.isView).map((list) => list.buffer));
    } catch (error) {
      postMessage({error: error.message, known: error instanceof PageError || error instanceof RangeError});
    }
  };
}
