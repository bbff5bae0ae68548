// Bytes of the page to numbers of voxels; pipeline/page/value_codec.h says how they are packed.

class PageError extends Error {}

const wait = () => new Promise((done) => setTimeout(done, 0));

async function bytesOf(id) {
  const element = document.getElementById(id);
  if (!element) throw new PageError('a part of the page is missing: ' + id);
  let packed;
  try {
    const text = element.textContent;
    if (Uint8Array.fromBase64) {
      packed = Uint8Array.fromBase64(text);
    } else {
      const raw = atob(text);
      packed = new Uint8Array(raw.length);
      for (let i = 0; i < raw.length; ++i) packed[i] = raw.charCodeAt(i);
    }
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  } catch (error) {
    throw new PageError('a part of the page is damaged: ' + id);
  }
}

function toHalf(value) {
  toHalf.float[0] = Math.max(-65504, Math.min(65504, value));
  const bits = toHalf.bits[0], sign = bits >>> 16 & 0x8000;
  const exponent = (bits >>> 23 & 255) - 112, mantissa = bits & 0x7fffff;
  if (exponent < -10) return sign;
  const whole = exponent > 0 ? mantissa : (mantissa | 0x800000);
  const shift = exponent > 0 ? 13 : 14 - exponent;
  let half = (exponent > 0 ? exponent << 10 : 0) + (whole >>> shift);
  const rest = whole & (1 << shift) - 1, middle = 1 << shift - 1;
  if (rest > middle || rest === middle && half & 1) ++half;
  return sign | half;
}
toHalf.float = new Float32Array(1);
toHalf.bits = new Uint32Array(toHalf.float.buffer);

function fromHalf(half) {
  const sign = half & 0x8000 ? -1 : 1, exponent = half >> 10 & 31, mantissa = half & 1023;
  return exponent === 0 ? sign * mantissa * 2 ** -24
                        : sign * (1024 + mantissa) * 2 ** (exponent - 25);
}

// Numbers of one channel, see EQ(page-prediction); `earlier` has three entries a voxel.
function channelNumbers(bytes, channel, earlier, into) {
  const n = into.length, low = 2 * n * channel, high = low + n;
  for (let i = 0; i < n; ++i) {
    const folded = bytes[low + i] | bytes[high + i] << 8;
    const a = earlier[3 * i], b = earlier[3 * i + 1], c = earlier[3 * i + 2];
    let p = 0;
    if (c >= 0) p = Math.floor((into[a] + into[b] + into[c]) / 3);
    else if (b >= 0) p = into[a] + into[b] >> 1;
    else if (a >= 0) p = into[a];
    into[i] = p + (folded & 1 ? -(folded + 1 >> 1) : folded >> 1);
  }
}

// Numbers of densities, see EQ(page-density).
async function unpackDensity(id, earlier) {
  const bytes = await bytesOf(id), n = earlier.length / 3;
  if (bytes.length !== 2 * n) throw new PageError('a part of the page is damaged: ' + id);
  const number = new Int16Array(n);
  channelNumbers(bytes, 0, earlier, number);
  return number;
}

// What a style adds voxel by voxel, see residual_codec.h: eight bytes each, three codes of colours, a weight, three view
// scales; `bytes`: of all texels.
async function unpackResidual(id, {scale, view, weight}, earlier, bytes) {
  const packed = await bytesOf(id), n = earlier.length / 3, number = new Int16Array(n), into = new Uint8Array(bytes).fill(255);
  const channels = [];
  for (let c = 0; c < 3 && scale; ++c) channels.push([c, (v) => v + 128]);
  for (let c = 4; c < 7 && view; ++c) channels.push([c, (v) => 255 - v]);
  if (weight) channels.push([3, (v) => v]);
  if (packed.length !== 2 * n * channels.length) throw new PageError('a part of the page is damaged: ' + id);
  if (!scale) for (let i = 0; i < n; ++i) into.fill(128, 8 * i, 8 * i + 3);
  for (const [k, [at, code]] of channels.entries()) {
    channelNumbers(packed, k, earlier, number);
    for (let i = 0; i < n; ++i) into[8 * i + at] = code(number[i]);
  }
  return new Uint32Array(into.buffer);
}

// Codes of 8 bits; put(first voxel, codes [count, channels], count).
async function unpackColors(id, header, channels, earlier, put, progress) {
  const bytes = await bytesOf(id), n = earlier.length / 3;
  const {matrix, scale, step} = header;
  if (bytes.length !== 2 * n * channels || matrix.length !== channels * channels ||
      scale.length !== channels)
    throw new PageError('a part of the page is damaged: ' + id);
  const numbers = [];
  for (let k = 0; k < channels; ++k) {
    numbers.push(new Int16Array(n));
    channelNumbers(bytes, k, earlier, numbers[k]);
    if (k % 4 === 3) {
      progress(0.5 * k / channels);
      await wait();
    }
  }
  // By parts whose sums stay in a cache.
  const part = 1024, sum = new Float64Array(part * channels), codes = new Uint8Array(part * channels);
  const rows = numbers.map((_, k) => Float64Array.from(matrix.slice(k * channels, (k + 1) * channels)));
  let shown = performance.now();
  for (let begin = 0; begin < n; begin += part) {
    const count = Math.min(part, n - begin);
    sum.fill(0);
    for (let k = 0; k < channels; ++k) {
      const own = numbers[k], row = rows[k];
      for (let i = 0, at = 0; i < count; ++i, at += channels) {
        const number = own[begin + i];
        if (number === 0) continue;
        const y = number * step;
        for (let j = 0; j < channels; ++j) sum[at + j] += row[j] * y;
      }
    }
    for (let i = 0, j = 0; i < count * channels; ++i) {
      const code = Math.fround(sum[i]) / scale[j];
      codes[i] = Math.max(-127, Math.min(127, code)) + 128.5;  // rounded down
      if (++j === channels) j = 0;
    }
    put(begin, codes, count);
    if (performance.now() - shown < 50) continue;
    progress(0.5 + 0.5 * begin / n);
    await wait();
    shown = performance.now();
  }
}
