// The buttons above the picture and the split, and what the same keys do.

// `changed` asks for a new picture, `fillFacts` for the sheet about the scene.
function bindActions(header, view, state, changed, fillFacts) {
  const press = (id, on) => element(id).ariaPressed = on;
  const sheets = [['show_path', 'path'], ['show_facts', 'facts'], ['show_help', 'help']];
  const toggle = (sheet) => () => {
    const open = element(sheet).hidden;
    for (const [b, s] of sheets) {
      if (element(s).contains(document.activeElement)) element(b).focus();
      element(s).hidden = s !== sheet || !open;
      element(b).ariaExpanded = s === sheet && open;
    }
    if (sheet === 'facts') fillFacts();
    if (sheet === 'help' && open) element('help').focus();  // it has nothing else to reach by keys
  };
  const actions = {
    home() { view.go(view.photos[header.home]); view.pivot = view.pivotOfHome; changed(); },
    mode() { view.mode = view.mode === 'orbit' ? 'fly' : 'orbit'; press('mode', view.mode === 'fly'); },
    original(on) { if (state.original !== on) { state.original = on; changed(); } },
    halve() {
      state.split = !state.split;
      press('halve', state.split);
      element('half').hidden = element('split').hidden = !state.split;
      changed();
    }};
  actions.keys = {h: actions.home, f: actions.mode, c: () => actions.original(true), v: actions.halve,
                  k: toggle('path'), i: toggle('facts'), '?': toggle('help'), escape: () => {
                    for (const [, s] of sheets) if (!element(s).hidden) toggle(s)();
                  }};
  actions.released = {c: () => actions.original(false)};
  element('home').onclick = actions.home;
  element('mode').onclick = actions.mode;
  element('halve').onclick = actions.halve;
  element('show_path').onclick = actions.keys.k;
  element('show_facts').onclick = actions.keys.i;
  element('show_help').onclick = actions.keys['?'];
  const compare = element('compare');
  compare.onpointerdown = () => actions.original(true);
  compare.onpointerup = compare.onpointerleave = compare.onblur = () => actions.original(false);
  compare.onkeydown = (event) => { if (event.key === ' ' || event.key === 'Enter') actions.original(true); };
  compare.onkeyup = () => actions.original(false);
  element('cut').oninput = () => {
    state.cut = element('cut').value / 100;
    showCut();
    changed();
  };
  const showCut = () => {
    element('split').style.left = 100 * state.cut + '%';
    element('cut').ariaValueText = Math.round(100 * state.cut) + ' % of the width';
  };
  showCut();
  return actions;
}
