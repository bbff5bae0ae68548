// Mouse, touch and keys to movements of the view.

function bindControls(canvas, view, changed, actions) {
  const pointers = new Map();
  let spread = 0, middle = [0, 0], lastTap = 0;
  const both = () => {
    const [a, b] = [...pointers.values()];
    return [Math.hypot(a[0] - b[0], a[1] - b[1]), [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]];
  };
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (pointers.size === 2) [spread, middle] = both();
    if (event.pointerType === 'touch' && pointers.size === 1) {
      if (event.timeStamp - lastTap < 300) actions.home();
      lastTap = event.timeStamp;
    }
  });
  canvas.addEventListener('pointermove', (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const side = Math.min(canvas.clientWidth, canvas.clientHeight);
    const dx = (event.clientX - before[0]) / side, dy = (event.clientY - before[1]) / side;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (pointers.size === 2) {
      const [now, place] = both();
      if (spread > 0) view.mode === 'orbit' ? view.approach(Math.max(-0.5, 1 - spread / now))
                                            : view.move(0, 0, (now - spread) / side);
      view.move(-(place[0] - middle[0]) / side, (place[1] - middle[1]) / side, 0);
      [spread, middle] = [now, place];
    } else if (event.buttons & 6 || event.shiftKey) {
      view.move(-dx, dy, 0);
    } else {
      const angle = view.mode === 'orbit' ? 3 : 1.2;
      view.mode === 'orbit' ? view.turn(-angle * dx, -angle * dy) : view.turn(-angle * dx, -angle * dy);
    }
    changed();
  });
  for (const name of ['pointerup', 'pointercancel'])
    canvas.addEventListener(name, (event) => {
      pointers.delete(event.pointerId);
      spread = 0;
    });
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    const way = -event.deltaY * (event.deltaMode === 1 ? 30 : 1) / 800;
    view.mode === 'orbit' ? view.approach(Math.max(-0.5, Math.min(0.5, way))) : view.move(0, 0, 0.3 * way);
    changed();
  }, {passive: false});

  const held = new Set();
  const moving = 'w a s d q e arrowleft arrowright arrowup arrowdown + -'.split(' ');
  const typed = (event) => event.target.closest?.('input, select, textarea');
  addEventListener('keydown', (event) => {
    const key = event.key === '=' ? '+' : event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey || event.altKey || typed(event) && key !== 'escape') return;
    if (moving.includes(key)) {
      if (key.startsWith('arrow') && event.target.closest?.('#photos')) return;
      held.add(key);
      event.preventDefault();
      changed();
    } else if (actions.keys[key] && !event.repeat) {
      actions.keys[key](true);
    }
  });
  addEventListener('keyup', (event) => {
    const key = event.key === '=' ? '+' : event.key.toLowerCase();
    held.delete(key);
    actions.released[key]?.();
  });
  addEventListener('blur', () => held.clear());

  // What the held keys do in `seconds`.
  return (seconds) => {
    if (held.size === 0) return;
    const on = (key) => held.has(key) ? 1 : 0, way = 0.4 * seconds, angle = seconds;
    view.move(way * (on('d') - on('a')), way * (on('e') - on('q')), way * (on('w') - on('s')));
    const right = on('arrowright') - on('arrowleft'), down = on('arrowdown') - on('arrowup');
    const sign = view.mode === 'orbit' ? -1 : 1;
    if (right || down) view.turn(sign * angle * right, sign * -angle * down * -1);
    if (on('+') || on('-')) view.approach(seconds * (on('+') - on('-')));
    changed();
  };
}
