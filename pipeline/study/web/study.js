'use strict';
// One participant's way through a study: an order of trials, one choice for each, and a file.
(() => {
const $ = (id) => document.getElementById(id);
const study = JSON.parse($('study').textContent);
const KEY = 'regrade study ' + study.id;

// Mulberry32 (public domain): numbers in [0, 1) from a participant's 32 bits.
function randomFrom(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

function shuffle(list, random) {
  for (let i = list.length - 1; i > 0; --i) {
    const j = Math.floor(random() * (i + 1));
    [list[i], list[j]] = [list[j], list[i]];
  }
  return list;
}

// The choice sets of a clip: every pair of methods, or all methods at once.
function sets() {
  const all = study.methods.map((_, m) => m);
  if (study.protocol === 'liprf') return [all];
  return all.flatMap((a) => all.slice(a + 1).map((b) => [a, b]));
}

// Places are counterbalanced: from clip to clip a set is turned by one place, and where a
// participant begins is random. Checks stand between the trials, never first.
function makeTrials(participant) {
  const random = randomFrom(parseInt(participant, 16));
  const begin = Math.floor(random() * 1024);
  const trials = [];
  study.clips.forEach((clip, c) => sets().forEach((set, s) => {
    const turn = (begin + c + s) % set.length;
    trials.push({clip: c, shown: set.slice(turn).concat(set.slice(0, turn))});
  }));
  shuffle(trials, random);
  for (let k = 0; k < study.checks; ++k) {
    const shown = trials[Math.floor(random() * trials.length)].shown.slice();
    const at = 1 + Math.floor(random() * trials.length);
    trials.splice(at, 0, {clip: Math.floor(random() * study.clips.length), shown,
                          asked: Math.floor(random() * shown.length)});
  }
  return trials;
}

// Answers are kept twice: Chromium's storage of pages from files was seen empty after a reload
// on a busy machine, and the history of a tab ends with the tab.
function load() {
  const kept = [history.state];
  try {
    kept.push(JSON.parse(localStorage.getItem(KEY)));
  } catch (error) { /* a browser without storage */ }
  const own = kept.filter((k) => k && k.study === study.id && /^[0-9a-f]{8}$/.test(k.participant) && Array.isArray(k.answers));
  if (own.length) return own.reduce((a, b) => b.answers.length > a.answers.length ? b : a);
  const participant = crypto.getRandomValues(new Uint32Array(1))[0].toString(16).padStart(8, '0');
  return {study: study.id, participant, answers: []};
}

const state = load();
const trials = makeTrials(state.participant);
const urls = new Map();
let shown_at = 0, timer = 0;

function store() {
  history.replaceState(state, '');
  try {
    localStorage.setItem(KEY, JSON.stringify(state));
  } catch (error) { /* see load() */ }
}

function urlOf(clip, method) {
  const key = clip + ' ' + method;
  if (!urls.has(key)) {
    const text = atob(study.clips[clip].films[method]), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    urls.set(key, URL.createObjectURL(new Blob([bytes], {type: study.clips[clip].type})));
  }
  return urls.get(key);
}

function element(name, className, text) {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}

function show() {
  const number = state.answers.length, trial = trials[number];
  $('start').hidden = true;
  $('trial').hidden = !trial;
  $('end').hidden = !!trial;
  clearTimeout(timer);
  if (!trial) return finish();
  $('question').textContent = study.question;
  $('progress').textContent = `${number + 1} of ${trials.length}`;
  const films = trial.shown.map((method, place) => {
    const film = element('div', 'film'), video = element('video');
    Object.assign(video, {src: urlOf(trial.clip, method), muted: true, loop: true, autoplay: true, playsInline: true});
    const choose = element('button', '', `Film ${place + 1}`);
    choose.disabled = true;
    choose.onclick = () => answer(place);
    film.append(video, choose);
    if (trial.asked === place) film.append(element('div', 'sign', 'To show that you are reading: choose this film.'));
    return film;
  });
  $('films').replaceChildren(...films);
  shown_at = performance.now();
  // Films begin together, and can be chosen from the moment that there was something to see.
  const ready = films.map((film) => new Promise((done) => {
    const video = film.firstChild;
    video.onloadeddata = video.onerror = done;
  }));
  Promise.all(ready).then(() => {
    if (state.answers.length !== number) return;
    for (const film of films) {
      film.firstChild.currentTime = 0;
      film.firstChild.play().catch(() => {});
    }
    shown_at = performance.now();
    timer = setTimeout(() => films.forEach((film) => { film.querySelector('button').disabled = false; }),
                       study.seconds * 1000);
  });
}

function answer(place) {
  const trial = trials[state.answers.length];
  const given = {clip: study.clips[trial.clip].name, shown: trial.shown, chosen: trial.shown[place],
                 milliseconds: Math.round(performance.now() - shown_at)};
  if (trial.asked !== undefined) Object.assign(given, {check: true, passed: trial.asked === place});
  state.answers.push(given);
  store();
  show();
}

function textOfAnswers() {
  return JSON.stringify({format: 'regrade study answers', version: 1, study: study.id, protocol: study.protocol,
                         question: study.question, methods: study.methods, participant: state.participant,
                         trials: trials.length, answers: state.answers}, null, 1);
}

function finish() {
  $('text').value = textOfAnswers();
  $('save').onclick = () => {
    const link = element('a');
    link.href = URL.createObjectURL(new Blob([$('text').value], {type: 'application/json'}));
    link.download = `answers_${study.id}_${state.participant}.json`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  };
}

document.addEventListener('keydown', (event) => {
  if ($('trial').hidden || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
  const button = $('films').querySelectorAll('button')[Number(event.key) - 1];
  if (button && !button.disabled) button.click();
});

$('count').textContent = trials.length;
$('at_once').textContent = sets()[0].length;
$('begin').onclick = show;
if (state.answers.length) show();
})();
