// Starts the page: unpacks the scene, binds the controls, and paints.

const PAGE_FORMAT = 3;

// `added`: styles that the page has learned since it was opened.
function readHeader(added) {
  let header = null;
  try { header = JSON.parse(element('scene').textContent); } catch (error) { /* said below */ }
  if (!header || typeof header !== 'object') throw new PageError('a part of the page is damaged: scene');
  if (header.format !== PAGE_FORMAT) throw new PageError('this page was made by another version of regrade');
  const numbers = (v, n) => Array.isArray(v) && v.length === n && v.every(Number.isFinite);
  const {splats} = header, isField = numbers(header.center, 3) && numbers(header.radius, 3) && [1, 4, 9].includes(header.basis) &&
      splats?.count > 0 && splats.count <= 1 << 26 && splats.coarse >= 0 && splats.coarse <= splats.count && splats.position_step > 0;
  if (!isField || !header.cameras?.[header.home])
    throw new PageError('a part of the page is damaged: scene');
  header.styles.push(...added);
  return header;
}

function fail(error) {
  const known = error instanceof PageError || error instanceof RangeError;
  say(known ? 'The scene cannot be shown: ' + error.message + '.'
            : 'The scene cannot be shown; this browser says: ' + error.message);
  if (!known) throw error;
}

async function start(page) {
  const header = readHeader(page.added ??= []), canvas = element('canvas'), round = page.round = {};
  const gl = canvas.getContext('webgl2', {antialias: false, preserveDrawingBuffer: true, powerPreference: 'high-performance'});
  if (!gl) throw new PageError('this browser has no WebGL 2, or has switched it off');
  if (typeof DecompressionStream === 'undefined') throw new PageError('this browser is too old');
  // It opens as its first style shows it. `ready`: a style can be shown.
  const state = page.state ??= {axes: [0, 1], amount: [header.styles[0]?.strength ?? 0, 0], ready: header.styles.length === 0,
                                original: false, split: false, cut: 0.5, map: null, playing: null};
  let unpacked = 0;
  const sayUnpacked = () => say((state.ready ? '' : styleTitle(header, 0) + ' is coming. ') +
                                    'The scene is being unpacked: ' + Math.round(100 * unpacked) + ' %');
  sayUnpacked();
  const decoded = decodedField(header, true, (part) => {
    unpacked = part;
    if (page.round === round) sayUnpacked();
  });
  const graphics = new Graphics(gl);
  // Null: the context was lost meanwhile.
  const whole = decoded.then((made) => {
    unpacked = 1;
    return page.round === round ? new SplatScene(header, made, graphics) : null;
  });
  whole.catch(() => {});  // it is awaited below
  let scene = await loadCoarse(header, graphics) ?? await whole, painter = null;
  if (page.round !== round) return;
  const view = page.view ??= new View(header);
  const coarse = scene.coarse ? new SceneStyles(graphics, Promise.resolve(scene), header) : null;
  const styles = new SceneStyles(graphics, whole, header), {colors, loading} = styles;

  const weights = () => header.styles.map((_, i) => {
    const axis = state.axes.indexOf(i);
    return axis >= 0 ? state.amount[axis] ?? 0 : 0;
  });
  const stylesOf = (of) => of.coarse ? coarse : styles;
  function setsOf(wanted, of = scene) {
    let rest = 1;
    const sets = [], known = stylesOf(of).colors;
    wanted.forEach((weight, i) => {
      if (!(weight > 0) || !known[i] || sets.length === 2) return;
      sets.push({weight, colors: known[i]});
      rest -= weight;
    });
    return rest > 1e-6 || sets.length === 0 ? [{weight: Math.max(rest, 0), colors: of.source}, ...sets] : sets;
  }
  const failed = (error) => { if (page.round === round && !gl.isContextLost()) fail(error); };
  const tried = new Set();  // styles whose loading has ended, well or not
  function load(i, codes) {
    return loading[i] ??= styles.make(i, (part) => {
      say(part < 1 ? styleTitle(header, i) + ' is being applied: ' + Math.round(100 * part) + ' %' : '');
    }, codes).then(() => {
      // Of many styles those that no slider shows make room.
      if (colors.filter(Boolean).length > 3)
        colors.forEach((c, k) => { if (c && k !== i && !state.axes.includes(k)) styles.forget(k); });
      say('');
      painter.change();
    }).catch(failed).finally(() => tried.add(i));
  }
  // What the sliders want, of the scene that is shown: the coarse one has the processor's cores to itself.
  const wanted = () => weights().flatMap((weight, i) => weight > 0 ? [i] : []);
  const loadWanted = () => Promise.all(wanted().map((i) => !scene.coarse ? load(i)
      : coarse.loading[i] ??= coarse.make(i, () => {}, null).then(() => painter.change()).catch(failed)));
  const isStyled = () => wanted().every((i) => stylesOf(scene).colors[i]);
  const pictureOf = (width, height) => {
    const styled = setsOf(weights()), source = [{weight: 1, colors: scene.source}];
    const {map} = state;
    const parts = state.original ? [{from: 0, to: 1, sets: source}]
        : state.split ? [{from: 0, to: state.cut, sets: source}, {from: state.cut, to: 1, sets: styled, map}]
        : [{from: 0, to: 1, sets: styled, map}];
    return {view: view.inWindow(width, height), parts};
  };
  painter = new Painter(canvas, graphics, scene, pictureOf);
  let sayUnstyled = () => {};
  const changed = () => {
    if (wanted().length === 0) sayUnstyled();
    painter.change();
  };
  let showStyles;
  const refreshStyles = () => {
    showStyles = bindStyles(header, state, () => {
      loadWanted();
      changed();
    });
    element('compare').hidden = element('halve').hidden = header.styles.length === 0 && !state.map;
  };
  refreshStyles();
  bindPhotos(header, view, changed);
  const path = page.path ??= new CameraPath();
  const take = (key) => {
    Object.assign(view, {eye: key.eye.slice(), forward: unit(key.forward), top: unit(key.up), half: key.half.slice()});
    state.axes.forEach((style, axis) => { if (style < key.weights.length) state.amount[axis] = key.weights[style]; });
    loadWanted();
    showStyles();
    changed();
  };
  bindPath(path, state, header, () => view.save(), weights, take, changed);
  // A style that the program behind the page has learned, or is learning; the last one, or a new one.
  const putStyle = async (i, {weights: packed, codes, ...style}) => {
    const isNew = i === header.styles.length, before = colors[i];
    element('network_' + i)?.remove();
    document.body.append(make('script', {type: 'application/octet-stream', id: 'network_' + i, textContent: packed}));
    if (!isNew) {
      loading[i] = null;  // what is shown stays until the next one is ready
      page.added.pop();
      header.styles.pop();
    }
    page.added.push(style);
    header.styles.push(style);
    await load(i, codes);
    if (before !== colors[i]) styles.free(before);
    if (!isNew) return;
    const axis = Math.min(i, 1);
    state.axes = axis === 0 ? [0, 1] : [state.axes[0], i];
    state.amount = [0, 0];
    state.amount[axis] = 1;
    page.clearPicture();
    refreshStyles();
    changed();
  };
  const removeStyle = (i) => {
    styles.forget(i);
    header.styles.pop();
    page.added.pop();
    Object.assign(state, {axes: [0, 1], amount: [0, 0]});
    refreshStyles();
    changed();
  };
  bindPicture(header, page, (map, isNew) => {
    if (map && isNew) state.amount = [0, 0];
    state.map = map;
    refreshStyles();
    changed();
  }, (file) => page.learned = learnStyle(page, file));
  // A moment of the path, as the canvas would show it.
  const pictureOfPath = async (key, width, height) => {
    const full = await whole;
    for (let i = 0; i < key.weights.length; ++i) if (key.weights[i] > 0) await load(i);
    const at = Object.assign(Object.create(view), {eye: key.eye, forward: key.forward, top: key.up, half: key.half}).at(width, height);
    await full.arrange(at);
    const target = graphics.target(width, height);
    full.draw(at, setsOf(key.weights, full), state.map, target, {x: 0, y: 0, width, height});
    const pixels = graphics.read(target);
    target.free();
    await wait();
    return pixels;
  };
  // For tests.
  page.moment = pictureOfPath;
  Object.assign(page, {state, putStyle, removeStyle});
  page.colorMaps = (rows) => rows.map((pair) => {
    const [source, style] = pair.map((n) => ({mean: n.slice(0, 3), covariance: n.slice(3)}));
    const map = colorMap(source, style);
    return [...map.offset, ...map.matrix];
  });
  page.film = async () => {
    const {fps} = path;
    let going = true;
    const ended = offerCancel(() => going = false);
    try {
      const longest = Math.max(16, Math.min(4096, Number(element('film_size').value) || 1280));
      const made = await makeFilm(path, longest, fps, pictureOfPath, (part) => {
        say('The film is being made: ' + Math.round(100 * part) + ' %');
        return going;
      });
      say('');
      return made;
    } finally {
      ended();
    }
  };
  const save = (film) => async () => {
    try {
      const blob = await film();
      if (blob) saveFile(blob, 'film.mp4');
    } catch (error) {
      if (!(error instanceof PageError)) throw error;
      sayBriefly('There is no film: ' + error.message + '.');
    }
  };
  element('save_film').onclick = save(async () => {
    const made = await page.film();
    if (made) sayBriefly(made.count + ' frames of ' + made.width + ' x ' + made.height + ', ' + made.codec);
    return made?.film;
  });
  element('exact_film').hidden = !page.live;
  element('exact_film').onclick = save(() => page.live.film(path.text(header.styles.map((s) => s.id))));

  const actions = bindActions(header, view, state, changed, () => factsOf(header, scene, graphics, painter));
  page.controls ??= bindControls(canvas, view, () => page.changed(), {
    home: () => page.actions.home(),
    keys: Object.fromEntries(Object.keys(actions.keys).map((k) => [k, () => page.actions.keys[k]()])),
    released: {c: () => page.actions.released.c()}});
  Object.assign(page, {actions, changed, graphics, painter, header, load, colors, setsOf, weights, resize: () => painter.resize()});
  // The picture in the file, which has the style, stays until the scene has it too.
  await loadWanted();
  if (page.round !== round) return;
  const showReady = () => {
    state.ready ||= isStyled();
    showStyles();
  };
  showReady();
  if (scene.coarse && state.ready && unpacked < 1) sayUnpacked();
  canvas.classList.add('ready');
  let before = performance.now();
  const run = page.run = () => {
    if (page.run !== run || gl.isContextLost()) return;
    const now = performance.now(), seconds = Math.min(0.1, (now - before) / 1000);
    before = now;
    page.controls(seconds);
    if (state.playing !== null) {
      state.playing += seconds;
      if (state.playing >= path.seconds) {
        take(path.keyframes[path.keyframes.length - 1]);
        element('play').onclick();
      } else {
        take(path.at(state.playing));
      }
    }
    painter.step();
    requestAnimationFrame(run);
  };
  run();
  const full = await whole;
  if (!full) return;
  // So does the coarse scene, unless no style is wanted.
  while (wanted().some((i) => !tried.has(i)))
    await Promise.race([new Promise((done) => sayUnstyled = done), Promise.all(wanted().map((i) => load(i)))]);
  if (page.round !== round) return;
  const first = scene;
  scene = page.scene = full;
  if (first.coarse) {
    painter.take(scene);
    await coarse.end();
    first.free();
  }
  showReady();
  if (isStyled()) say('');
  // For tests: RGBA rows from the bottom, of any view and weights.
  page.picture = async ({rotation, eye, lens, width, height, weights: wanted}) => {
    for (let i = 0; i < wanted.length; ++i) if (wanted[i] > 0) await load(i);
    await scene.arrange({rotation, eye, lens});
    const target = graphics.target(width, height);
    scene.draw({rotation, eye, lens}, setsOf(wanted), null, target, {x: 0, y: 0, width, height});
    const pixels = graphics.read(target);
    target.free();
    return pixels;
  };
  page.begun = true;
}

const page = {live: Live.begin()};
globalThis.regradePage = page;  // for tests
const begin = () => page.started = start(page).catch(fail);
element('canvas').addEventListener('webglcontextlost', (event) => {
  event.preventDefault();
  say('The graphics processor was reset; the scene is being made again.');
});
element('canvas').addEventListener('webglcontextrestored', begin);
bindDrop(page);
addEventListener('resize', () => page.resize?.());
begin();
