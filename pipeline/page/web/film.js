// The camera path as an MP4 film, encoded by the browser (WebCodecs), wrapped here.

const CODECS = ['avc1.640028', 'avc1.640034', 'avc1.4d0028', 'avc1.42e028', 'vp09.00.40.08'];

async function filmCodec(width, height, fps) {
  if (typeof VideoEncoder === 'undefined') return null;
  for (const codec of CODECS) {
    const config = {codec, width, height, framerate: fps, bitrate: Math.max(2e6, 0.25 * width * height * fps),
                    ...(codec.startsWith('avc1') ? {avc: {format: 'avc'}} : {})};
    try {
      if ((await VideoEncoder.isConfigSupported(config)).supported) return config;
    } catch (error) { /* the next one */ }
  }
  return null;
}

// RGBA rows from the bottom to 4:2:0 of BT.709, limited range.
function toYuv(rgba, width, height) {
  const half = width / 2, size = width * height, yuv = new Uint8Array(size * 3 / 2);
  for (let y = 0; y < height; y += 2)
    for (let x = 0; x < width; x += 2) {
      let r = 0, g = 0, b = 0;
      for (let k = 0; k < 4; ++k) {
        const px = x + (k & 1), py = y + (k >> 1), i = 4 * ((height - 1 - py) * width + px);
        r += rgba[i];
        g += rgba[i + 1];
        b += rgba[i + 2];
        yuv[py * width + px] = 16.5 + (0.2126 * rgba[i] + 0.7152 * rgba[i + 1] + 0.0722 * rgba[i + 2]) * (219 / 255);
      }
      const luma = 0.2126 * r + 0.7152 * g + 0.0722 * b, at = size + (y >> 1) * half + (x >> 1);
      yuv[at] = 128.5 + (b - luma) / 4 / 1.8556 * (224 / 255);
      yuv[at + size / 4] = 128.5 + (r - luma) / 4 / 1.5748 * (224 / 255);
    }
  return yuv;
}

const u16 = (...values) => values.flatMap((v) => [v >> 8 & 255, v & 255]);
const u32 = (...values) => values.flatMap((v) => [v >>> 24, v >>> 16 & 255, v >>> 8 & 255, v & 255]);
const ascii = (text) => [...text].map((c) => c.charCodeAt(0));

function box(type, ...parts) {
  const size = parts.reduce((sum, part) => sum + part.length, 8), bytes = new Uint8Array(size);
  bytes.set([...u32(size), ...ascii(type)]);
  let at = 8;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

// One track of frames of equal length. `chunks`: bytes of each; `keys`: numbers of those that stand alone.
function mp4Of(config, description, chunks, keys, width, height, fps) {
  const rate = Math.round(1000 * fps), length = 1000 * chunks.length;
  const matrix = u32(0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000), avc = config.codec.startsWith('avc1');
  const setup = avc ? box('avcC', new Uint8Array(description))
                    : box('vpcC', [1, 0, 0, 0, 0, 40, 8 << 4 | 1 << 1, 1, 1, 1, 0, 0]);
  const entry = box(avc ? 'avc1' : 'vp09', [0, 0, 0, 0, 0, 0, 0, 1], new Uint8Array(16), u16(width, height),
                    u32(0x480000, 0x480000, 0), u16(1), new Uint8Array(32), u16(24, 0xffff), setup,
                    box('colr', ascii('nclx'), u16(1, 1, 1), [0]));
  const head = box('ftyp', ascii('isom'), u32(512), ascii(avc ? 'isomiso2avc1mp41' : 'isomiso2mp41'));
  const index = (offset) => box('moov',
      box('mvhd', u32(0, 0, 0, rate, length, 0x10000), u16(0x100, 0), u32(0, 0), matrix, new Uint8Array(24), u32(2)),
      box('trak',
          box('tkhd', u32(3, 0, 0, 1, 0, length, 0, 0, 0, 0), matrix, u32(width << 16, height << 16)),
          box('mdia',
              box('mdhd', u32(0, 0, 0, rate, length), u16(0x55c4, 0)),
              box('hdlr', u32(0, 0), ascii('vide'), new Uint8Array(13)),
              box('minf', box('vmhd', u32(1, 0, 0)), box('dinf', box('dref', u32(0, 1), box('url ', u32(1)))),
                  box('stbl', box('stsd', u32(0, 1), entry), box('stts', u32(0, 1, chunks.length, 1000)),
                      box('stss', u32(0, keys.length, ...keys)), box('stsc', u32(0, 1, 1, chunks.length, 1)),
                      box('stsz', u32(0, 0, chunks.length, ...chunks.map((c) => c.length))),
                      box('stco', u32(0, 1, offset)))))));
  const offset = head.length + index(0).length + 8, size = chunks.reduce((sum, c) => sum + c.length, 8);
  return new Blob([head, index(offset), new Uint8Array([...u32(size), ...ascii('mdat')]), ...chunks], {type: 'video/mp4'});
}

// `picture(key, width, height)`: RGBA of a moment of the path. Frames are those of `regrade render --path`.
async function makeFilm(path, longest, fps, picture, progress) {
  const half = path.keyframes[0].half, larger = Math.max(...half);
  const [width, height] = half.map((h) => Math.max(2, 2 * Math.floor(longest * h / larger / 2)));
  const config = await filmCodec(width, height, fps);
  if (!config) throw new PageError('this browser encodes no films: save camera_path.json for regrade render --path');
  const chunks = [], keys = [], count = Math.max(2, Math.round(path.seconds * fps));
  let description = null, failed = null, last = -1;
  const encoder = new VideoEncoder({
    output(chunk, metadata) {
      if (chunk.timestamp <= last) failed = new PageError('this browser encodes frames out of order');
      last = chunk.timestamp;
      const bytes = new Uint8Array(chunk.byteLength);
      chunk.copyTo(bytes);
      chunks.push(bytes);
      if (chunk.type === 'key') keys.push(chunks.length);
      description ??= metadata?.decoderConfig?.description;
    },
    error(error) { failed = new PageError('this browser cannot encode the film: ' + error.message); }});
  const colorSpace = {primaries: 'bt709', transfer: 'bt709', matrix: 'bt709', fullRange: false};
  try {
    encoder.configure(config);
    for (let i = 0; i < count && !failed; ++i) {
      if (progress(i / count) === false) return null;
      const rgba = await picture(path.at(path.seconds * i / (count - 1)), width, height);
      const frame = new VideoFrame(toYuv(rgba, width, height), {
        format: 'I420', codedWidth: width, codedHeight: height, colorSpace,
        timestamp: Math.round(1e6 * i / fps), duration: Math.round(1e6 / fps)});
      encoder.encode(frame, {keyFrame: i % 60 === 0});
      frame.close();
      while (encoder.encodeQueueSize > 4) await wait();
    }
    if (!failed) await encoder.flush();
  } finally {
    if (encoder.state !== 'closed') encoder.close();
  }
  if (failed) throw failed;
  if (chunks.length !== count) throw new PageError('this browser has lost frames of the film');
  return {film: mp4Of(config, description, chunks, keys, width, height, fps), count, width, height, codec: config.codec};
}
