// Bytes of the page to numbers of splats; pipeline/page/value_codec.h says how they are packed.

class PageError extends Error {}

const wait = () => new Promise((done) => setTimeout(done, 0));

// Compressed bytes of a text in base64, as a stream.
function streamOf(text) {
  let packed;
  if (Uint8Array.fromBase64) {
    packed = Uint8Array.fromBase64(text);
  } else {
    const raw = atob(text);
    packed = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; ++i) packed[i] = raw.charCodeAt(i);
  }
  return new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
}

const damaged = (id) => new PageError('a part of the page is damaged: ' + id);

async function inflated(text, id) {
  try {
    return new Uint8Array(await new Response(streamOf(text)).arrayBuffer());
  } catch (error) {
    throw damaged(id);
  }
}

// Calls put(channel, its 2 n bytes) for each; no more than one of them is in memory.
async function eachChannel(text, id, n, channels, put) {
  const bytes = new Uint8Array(2 * n);
  let filled = 0, channel = 0;
  try {
    const reader = streamOf(text).getReader();
    for (;;) {
      const {value, done} = await reader.read();
      if (done) break;
      for (let at = 0; at < value.length;) {
        if (channel === channels) throw damaged(id);
        const part = Math.min(value.length - at, bytes.length - filled);
        bytes.set(value.subarray(at, at + part), filled);
        filled += part;
        at += part;
        if (filled < bytes.length) continue;
        await put(channel++, bytes);
        filled = 0;
      }
    }
  } catch (error) {
    throw damaged(id);
  }
  if (channel !== channels || filled > 0) throw damaged(id);
}

function fromHalf(half) {
  const sign = half & 0x8000 ? -1 : 1, exponent = half >> 10 & 31, mantissa = half & 1023;
  return exponent === 0 ? sign * mantissa * 2 ** -24
                        : sign * (1024 + mantissa) * 2 ** (exponent - 25);
}

// Numbers of one channel, see EQ(page-prediction); `earlier` has three entries a splat.
function channelNumbers(bytes, earlier, into) {
  const n = into.length;
  for (let i = 0; i < n; ++i) {
    const folded = bytes[i] | bytes[n + i] << 8;
    const a = earlier[3 * i], b = earlier[3 * i + 1], c = earlier[3 * i + 2];
    let p = 0;
    if (c >= 0) p = Math.floor((into[a] + into[b] + into[c]) / 3);
    else if (b >= 0) p = into[a] + into[b] >> 1;
    else if (a >= 0) p = into[a];
    into[i] = p + (folded & 1 ? -(folded + 1 >> 1) : folded >> 1);
  }
}

// What a style adds splat by splat, see residual_codec.h: eight bytes each, three codes of colours, a weight, three view
// scales.
async function unpackResidual(text, id, {scale, view, weight}, earlier) {
  const n = earlier.length / 3, number = new Int16Array(n), into = new Uint8Array(8 * n).fill(255), channels = [];
  for (let c = 0; c < 3 && scale; ++c) channels.push([c, (v) => v + 128]);
  for (let c = 4; c < 7 && view; ++c) channels.push([c, (v) => 255 - v]);
  if (weight) channels.push([3, (v) => v]);
  if (!scale) for (let i = 0; i < n; ++i) into.fill(128, 8 * i, 8 * i + 3);
  await eachChannel(text, id, n, channels.length, (k, bytes) => {
    const [at, code] = channels[k];
    channelNumbers(bytes, earlier, number);
    for (let i = 0; i < n; ++i) into[8 * i + at] = code(number[i]);
  });
  return new Uint32Array(into.buffer);
}
