// The page's controls: styles, places of photos, keyframes, and what is known of the scene.

const element = (id) => document.getElementById(id);

function make(tag, properties, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

function say(text) { element('message').textContent = text; }

function sayBriefly(text) {
  say(text);
  setTimeout(() => { if (element('message').textContent === text) say(''); }, 4000);
}

// Shows the button that stops a job; the function that comes back hides it again.
function offerCancel(stop) {
  const button = element('cancel'), before = document.activeElement;
  button.hidden = false;
  button.onclick = stop;
  return () => {
    if (document.activeElement === button) (before?.isConnected ? before : element('canvas')).focus();
    button.hidden = true;
  };
}

function saveFile(blob, name) {
  const url = URL.createObjectURL(blob);
  make('a', {href: url, download: name}).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

// A page that is made for others may have no names.
const styleName = (header, i) => header.styles[i].name ?? 'Style ' + (i + 1);
const styleTitle = (header, i) => header.styles[i].name ? 'Style "' + header.styles[i].name + '"' : 'Style ' + (i + 1);

// A slider for each of two axes; of two styles or more, the axes' styles can be chosen.
function bindStyles(header, state, changed) {
  const count = header.styles.length, box = element('styles');
  box.replaceChildren();
  const update = [];
  for (let axis = 0; axis < Math.min(2, count); ++axis) {
    const id = 'style' + axis, name = (i) => styleName(header, i);
    const picture = make('img', {alt: '', src: header.styles[state.axes[axis]].picture});
    const output = make('output', {htmlFor: id, ariaHidden: 'true'});  // the slider says it
    const slider = make('input', {id, type: 'range', min: 0, max: 100, value: 100 * state.amount[axis]});
    const label = make('span', {}, picture);
    if (count > 2) {
      const select = make('select', {ariaLabel: 'Style of slider ' + (axis + 1)});
      header.styles.forEach((_, i) => select.append(make('option', {value: i, textContent: name(i)})));
      select.value = state.axes[axis];
      select.addEventListener('change', () => {
        if (state.axes[1 - axis] === Number(select.value)) return void (select.value = state.axes[axis]);
        state.axes[axis] = Number(select.value);
        picture.src = header.styles[state.axes[axis]].picture;
        show();
        changed();
      });
      label.append(select);
    } else {
      const text = count > 1 || header.styles[axis].name ? name(axis) : 'Original to style';
      label.append(make('label', {htmlFor: id, textContent: text, title: text}));
    }
    const show = () => {
      slider.value = Math.round(100 * state.amount[axis]);
      slider.disabled = !state.ready;
      slider.ariaValueText = output.textContent = Math.round(100 * state.amount[axis]) + ' %';
      if (count > 2) slider.ariaLabel = 'Weight of ' + name(state.axes[axis]);
    };
    slider.addEventListener('input', () => {
      state.amount[axis] = slider.value / 100;
      // The weights' sum stays at most 1.
      const other = 1 - axis;
      state.amount[other] = Math.min(state.amount[other] ?? 0, 1 - state.amount[axis]);
      update.forEach((run) => run());
      changed();
    });
    update.push(show);
    box.append(make('div', {className: 'axis'}, label, slider, output));
  }
  const all = () => update.forEach((run) => run());
  all();
  return all;
}

function bindPhotos(header, view, changed) {
  const box = element('photos');
  box.replaceChildren();
  header.photos.forEach((photo, i) => {
    const place = 'Place of photo ' + (photo.name ?? i + 1), button = make('button', {title: place, ariaLabel: place},
                        make('img', {alt: '', src: photo.picture, loading: 'lazy'}));
    button.addEventListener('click', () => {
      view.go(view.photos[photo.camera]);
      changed();
    });
    box.append(button);
  });
}

function bindPath(path, state, header, place, weights, go, changed) {
  const list = element('keyframes');
  const refresh = () => {
    // The keyboard stays where it was: at the same control of the same place, or the nearest one.
    const item = document.activeElement?.closest('#keyframes li'), row = [...list.children].indexOf(item);
    const column = item ? [...item.children].indexOf(document.activeElement) : -1;
    list.replaceChildren(...path.keyframes.map((key, i) => {
      const time = make('input', {type: 'number', min: 0, step: 0.1, value: key.time.toFixed(1),
                                  ariaLabel: 'Seconds of place ' + (i + 1), disabled: i === 0});
      time.addEventListener('change', () => {
        // Later places move along, so that times keep rising.
        const least = path.keyframes[i - 1].time + 0.1, shift = Math.max(least, Number(time.value) || 0) - key.time;
        for (let k = i; k < path.keyframes.length; ++k) path.keyframes[k].time += shift;
        refresh();
      });
      const show = make('button', {textContent: 'Show', ariaLabel: 'Show place ' + (i + 1)});
      show.addEventListener('click', () => go(key));
      const remove = make('button', {textContent: 'Remove', ariaLabel: 'Remove place ' + (i + 1)});
      remove.addEventListener('click', () => { path.remove(i); refresh(); });
      return make('li', {}, time, ' s', show, remove);
    }));
    if (item) (list.children[Math.min(row, list.children.length - 1)]?.children[column] ?? element('add_key')).focus();
    element('play').disabled = path.keyframes.length < 2;
    element('save_path').disabled = path.keyframes.length === 0;
    element('save_film').disabled = element('exact_film').disabled = path.keyframes.length < 2;
  };
  element('add_key').onclick = () => { path.add(place(), weights()); refresh(); };
  element('play').onclick = () => {
    state.playing = state.playing === null ? 0 : null;
    element('play').textContent = state.playing === null ? 'Play' : 'Stop';
    changed();
  };
  const fps = element('film_fps');
  fps.onchange = () => path.fps = fps.value = Math.max(1, Math.min(120, Number(fps.value) || 30));
  fps.value = path.fps;
  element('save_path').onclick = () =>
    saveFile(new Blob([path.text(header.styles.map((s) => s.id))], {type: 'application/json'}), 'camera_path.json');
  element('open_path').onchange = async (event) => {
    const file = event.target.files[0];
    if (!file) return;
    try {
      path.read(await file.text(), header.styles.map((s) => s.id));
      fps.value = path.fps;
      refresh();
    } catch (error) {
      if (!(error instanceof PageError)) throw error;
      sayBriefly(error.message + '.');
    }
    event.target.value = '';
  };
  refresh();
}

function factsOf(header, scene, graphics, painter) {
  const number = (n) => n.toLocaleString('en');
  const rows = [
    ['Splats', number(header.splats.count)],
    ['Size of this page', (document.documentElement.innerHTML.length / 1e6).toFixed(1) + ' MB'],
    ['On the graphics processor', (graphics.bytes / 1e6).toFixed(0) + ' MB'],
    ['Picture', painter.full.width + ' x ' + painter.full.height],
    ['A frame while moving', painter.frameTime.toFixed(0) + ' ms at ' + Math.round(100 * painter.part) + ' %']];
  if (header.check) rows.push(['To the exact field', header.check.worst_db.toFixed(1) + ' dB at least, of ' + header.check.views + ' views']);
  header.styles.forEach((style, i) => {
    if (style.bound) rows.push(['Certified bound, ' + styleName(header, i), style.bound.toFixed(2)]);
  });
  const list = make('dl', {});
  for (const [name, value] of rows) list.append(make('dt', {textContent: name}), make('dd', {textContent: value}));
  element('facts').replaceChildren(list, make('p', {className: 'soft',
    textContent: 'This page is a copy of a place. Whoever has it can look around there.'}));
}
