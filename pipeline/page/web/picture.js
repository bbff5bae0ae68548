// A picture that is dropped on the scene: the linear map from the scene's colours to its own, at
// once; see stylize/image/monge_kantorovich.h, EQ(mkl) and EQ(rank-weight). Matrices are rows.

const ROUNDING = 1 / (255 * 255 * 12);
const LONGEST = 512;  // side of the picture whose colours are measured

const product = (a, b) => [0, 1, 2].flatMap((i) => [0, 1, 2].map((j) =>
    a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]));
const transposed = (a) => [a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]];

// f of the eigenvalues of a symmetric matrix, by Jacobi's rotations.
function functionOf(matrix, f) {
  let m = matrix.slice(), v = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  for (let sweep = 0; sweep < 30; ++sweep)
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      const off = m[3 * p + q];
      if (off === 0) continue;
      const angle = 0.5 * Math.atan2(2 * off, m[4 * q] - m[4 * p]), c = Math.cos(angle), s = Math.sin(angle);
      const r = [1, 0, 0, 0, 1, 0, 0, 0, 1];
      r[4 * p] = r[4 * q] = c;
      r[3 * p + q] = s;
      r[3 * q + p] = -s;
      m = product(product(transposed(r), m), r);
      m[3 * p + q] = m[3 * q + p] = 0;
      v = product(v, r);
    }
  const values = [0, 4, 8].map((i) => f(Math.max(m[i], 0)));
  return product(v.map((x, i) => x * values[i % 3]), transposed(v));
}

// {matrix, offset} from one {mean, covariance} to another.
function colorMap(source, style) {
  const weight = (value) => {
    const t = Math.min(1, Math.log(Math.max(value / ROUNDING, 1)) / Math.log(100));
    return (t * t * (3 - 2 * t)) ** 2;
  };
  const root = functionOf(style.covariance, Math.sqrt);
  const g = product(root, functionOf(source.covariance, (v) => Math.sqrt(v * weight(v))));
  // With G = P S Q^T, H = P S^-1/2 Q^T = (G G^T)^-3/4 G.
  const inner = product(g, transposed(g)), least = 1e-14 * (inner[0] + inner[4] + inner[8]);
  const h = product(functionOf(inner, (v) => v > least ? v ** -0.75 : 0), g);
  const l = product(root, h);
  const matrix = product(product(l, functionOf(source.covariance, (v) => weight(v) ** 1.5)), transposed(l));
  const offset = [0, 1, 2].map((i) => style.mean[i] - dot(matrix.slice(3 * i, 3 * i + 3), source.mean));
  return {matrix, offset};
}

// Of RGBA bytes without transparency.
function statisticsOf(bytes) {
  const n = bytes.length / 4, mean = [0, 0, 0], covariance = [0, 0, 0, 0, 0, 0, 0, 0, 0];
  for (let i = 0; i < n; ++i) for (let c = 0; c < 3; ++c) mean[c] += bytes[4 * i + c];
  mean.forEach((sum, c) => mean[c] = sum / n / 255);
  for (let i = 0; i < n; ++i) {
    const d = [0, 1, 2].map((c) => bytes[4 * i + c] / 255 - mean[c]);
    for (let k = 0; k < 9; ++k) covariance[k] += d[Math.floor(k / 3)] * d[k % 3];
  }
  return {mean, covariance: covariance.map((sum) => sum / n)};
}

// {statistics, url}: its colours over white, and a small picture of it.
async function openPicture(file) {
  let picture;
  try {
    picture = await createImageBitmap(file);
  } catch (error) {
    throw new PageError('this browser cannot open this picture');
  }
  const drawn = (longest) => {
    const scale = Math.min(1, longest / Math.max(picture.width, picture.height));
    const canvas = make('canvas', {width: Math.max(1, Math.round(scale * picture.width)),
                                   height: Math.max(1, Math.round(scale * picture.height))});
    const context = canvas.getContext('2d', {colorSpace: 'srgb'});
    context.fillStyle = '#fff';
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(picture, 0, 0, canvas.width, canvas.height);
    return {canvas, context};
  };
  const {canvas, context} = drawn(LONGEST);
  const {data} = context.getImageData(0, 0, canvas.width, canvas.height);
  const url = drawn(128).canvas.toDataURL('image/jpeg', 0.75);
  picture.close();
  return {statistics: statisticsOf(data), url};
}

// The slider of the dropped picture. `shown` gets {matrix, offset} or null, and whether it is a new
// picture's; `taken` gets the file.
function bindPicture(header, page, shown, taken) {
  const box = element('dropped'), slider = element('dropped_part'), amount = element('dropped_amount');
  const identity = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const show = (isNew) => {
    const part = slider.value / 100, map = page.dropped?.map;
    box.hidden = !map;
    slider.ariaValueText = amount.textContent = slider.value + ' %';
    // EQ(style-mix): the mix of a map and no map is a map.
    shown(map ? {matrix: map.matrix.map((v, i) => (1 - part) * identity[i] + part * v),
                 offset: map.offset.map((v) => part * v)} : null, isNew);
  };
  const take = async (file) => {
    if (!file) return;
    const begun = performance.now();
    try {
      const picture = await openPicture(file);
      page.dropped = {map: colorMap(header.colors, picture.statistics), url: picture.url};
      element('dropped_picture').src = picture.url;
      slider.value = 100;
    } catch (error) {
      if (!(error instanceof PageError)) throw error;
      if (!page.live) return sayBriefly(error.message + '.');
      page.dropped = {map: null, url: ''};  // the program may
    }
    show(true);
    page.previewTime = performance.now() - begun;
    taken(file);
  };
  const clear = page.clearPicture = () => {
    page.dropped = null;
    show(false);
  };
  slider.oninput = () => show(false);
  element('remove_picture').onclick = () => {
    clear();
    element('open_picture').focus();
  };
  element('open_picture').onchange = (event) => {
    take(event.target.files[0]);
    event.target.value = '';
  };
  page.take = take;
  show(false);
}

// Anywhere on the page; a file that is let go beside it must not replace the page.
function bindDrop(page) {
  addEventListener('dragover', (event) => event.preventDefault());
  addEventListener('drop', (event) => {
    event.preventDefault();
    page.take?.(event.dataTransfer?.files[0]);
  });
}
