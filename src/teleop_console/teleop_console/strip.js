// The strip of time: what happened when, and which time the scene shows; all that it says are
// requests of its own.
(() => {
  'use strict';
  const POLL = 250, LIVE = 500, SPAN = 30, FRAME = 1 / 30, BAND = 15, PANE = 84, RULER = 18; // ms, ms, s, s, px
  const strip = document.createElement('section');
  strip.id = 't-strip'; strip.hidden = true; strip.setAttribute('aria-label', 'timeline');
  strip.innerHTML = `<div class="t-bar">
    <button type="button" data-do="play" title="the P key too">Play</button>
    <button type="button" data-do="now">Back to now</button>
    <output aria-live="off"></output>
    <select aria-label="speed" title="time of the recording per time that passes"></select>
    <label class="t-more"><input type="checkbox"> loop</label>
    <button type="button" data-do="in" class="t-more" aria-label="zoom in">+</button>
    <button type="button" data-do="out" class="t-more" aria-label="zoom out">−</button>
    <button type="button" data-do="all" class="t-more" title="double click on the strip too">Whole</button>
    <div class="t-find t-more"><input type="search" role="combobox" aria-label="plot a column" aria-expanded="false"
      aria-controls="t-found" placeholder="plot: name or unit" maxlength="100" autocomplete="off">
      <ul id="t-found" role="listbox" aria-label="columns" hidden></ul></div>
    <select class="t-more t-over" aria-label="lay over"></select>
    <select class="t-more t-align" aria-label="aligned at"><option value="start">from its start</option>
      <option value="following">from following</option></select>
    <button type="button" data-do="fold" aria-expanded="true">Fold</button></div>
    <canvas role="slider" tabindex="0" aria-label="time" aria-valuemin="0"></canvas>
    <div class="t-key t-more"></div>`;
  const one = (selector) => strip.querySelector(selector);
  const made = (kind, text = '', more = {}) => Object.assign(document.createElement(kind), { textContent: text }, more);
  const canvas = one('canvas'), pen = canvas.getContext('2d'), search = one('[type=search]'), list = one('ul');
  const speed = one('[aria-label=speed]'), loop = one('[type=checkbox]'), over = one('.t-over'), align = one('.t-align');
  const short = (number, digits) => { // in few characters, with a minus as it is printed
    const size = Math.abs(number), text = size && (size < 1e-3 || size >= 1e6) ? number.toExponential(1) : +number.toPrecision(digits);
    return String(text).replaceAll('-', '−'); };
  const sign = (text) => text.replace('-', '−');
  const narrow = () => innerWidth < 576 || innerHeight < 700;
  const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
  let state = null, at = 0, asked = 0, window_ = null, names = null, told = null, session = '';
  let left = 0, wide = 0, folded = narrow(), found = [], picked = 0, looks = false, past = null, again = 0;

  async function ask(path, words = []) {
    try {
      const answer = await fetch(`${path}?${new URLSearchParams(words)}`, { cache: 'no-store',
        headers: { 'Teleop-Page': window.teleopPage || 'new' }, signal: AbortSignal.timeout(10000) });
      return [answer.ok, await answer.json()];
    } catch { return [false, '']; }
  }
  async function act(path, words) {
    const [ok, said] = await ask(path, words);
    if (ok) take(said); else one('output').textContent = said || 'The console does not answer. Try again.';
  }
  const go = (words) => act('time', Object.entries(words));

  // -- time ----------------------------------------------------------------------------------------

  const range = () => window_ || (state.is_live ? [Math.max(state.begin, state.end - SPAN), Math.max(state.end, state.begin + 1)]
    : [state.begin, Math.max(state.end, state.begin + 1e-3)]);
  const now = () => past ?? (state.is_playing && !state.is_live
    ? Math.min(state.end, at + state.speed * (performance.now() - asked) / 1000) : at);
  const x = (time) => { const [a, b] = range(); return left + (time - a) / (b - a) * wide; };
  const time = (place) => { const [a, b] = range(); return a + (place - left) / wide * (b - a); };

  let seeking = false, next = null;
  async function seek(to) { // one request at a time, the newest last
    past = next = clamp(to, state.begin, state.end); draw();
    if (seeking) return;
    seeking = true;
    while (next !== null) { const wanted = next; next = null; await go({ seek: wanted.toFixed(4) }); }
    seeking = false;
    if (!state.is_live || !state.is_past) past = null;
    draw();
  }
  function zoom(factor, around = now()) {
    const [a, b] = range(), least = 0.01;
    const length = clamp((b - a) * factor, least, state.end - state.begin || least);
    const begin = clamp(around - (around - a) / (b - a) * length, state.begin, Math.max(state.begin, state.end - length));
    show(length >= state.end - state.begin - 1e-9 ? null : [begin, begin + length]);
  }
  function pan(seconds) {
    const [a, b] = range(), moved = clamp(seconds, state.begin - a, state.end - b);
    if (window_) show([a + moved, b + moved]);
  }
  function show(next) { window_ = next; draw(); look(); }
  function leave() { past = null; next = null; window_ = null; go({ now: 1 }); }

  function take(said) {
    if (!said.title) { state = null; strip.hidden = true; place(); return; }
    if (session !== said.title + said.is_live) {
      session = said.title + said.is_live;
      window_ = told = past = null; names = said.first; search.value = ''; folded = narrow();
      list.hidden = true; fill();
    }
    [state, at, asked] = [said, said.time, performance.now()];
    const live = state.is_live;
    if (live && !state.is_past && !seeking) past = null;
    const shown = now(), [a, b] = range();
    if (window_ && state.is_playing && !live && (shown < a || shown > b)) show([shown, shown + b - a].map((t) => Math.min(t, state.end)));
    strip.hidden = false;
    one('[data-do=play]').hidden = speed.hidden = live;
    loop.parentElement.hidden = over.hidden = live;
    align.hidden = live || !state.over;
    one('[data-do=now]').hidden = !live || !state.is_past;
    one('[data-do=play]').textContent = state.is_playing && !live ? 'Pause' : 'Play';
    one('[data-do=fold]').textContent = folded ? 'Unfold' : 'Fold';
    one('[data-do=fold]').setAttribute('aria-expanded', !folded);
    strip.classList.toggle('t-folded', folded);
    loop.checked = state.loop; speed.value = state.speed; align.value = state.align;
    if (over.value !== state.over) over.value = state.over;
    draw(); place();
  }
  function place() { // under the scene and the panel
    document.documentElement.classList.toggle('t-strips', !strip.hidden);
    document.documentElement.style.setProperty('--t-strip', `${strip.offsetHeight}px`);
  }

  // -- what is drawn -------------------------------------------------------------------------------

  async function fill() { // recordings that can be laid over
    const [ok, said] = await ask('timeline', [['find', '']]);
    if (ok) over.replaceChildren(made('option', 'lay over …', { value: '' }),
      ...(said.others || []).map((name) => made('option', name, { value: name })));
  }
  async function look() {
    if (looks || !state) { again = 1; return; }
    looks = true;
    do {
      again = 0;
      const [a, b] = range();
      const words = [['begin', a], ['end', b], ['pixels', Math.max(1, Math.round(wide || 300))]];
      const [ok, said] = await ask('strip', [...words, ...(folded ? [] : names).map((name) => ['name', name])]);
      if (ok && said.bands && state) { told = said; draw(); place(); }
      else if (!ok && said) { names = names.slice(0, -1); one('output').textContent = said; }
    } while (again);
    looks = false;
  }
  const waits = () => told && (told.waits || told.curves.some((curve) => curve.waits));

  function groups() { // curves of one unit have one axis
    const by = new Map();
    for (const curve of told && !folded ? told.curves : []) {
      if (!by.has(curve.unit)) by.set(curve.unit, []);
      by.get(curve.unit).push(curve);
    }
    return [...by].map(([unit, curves]) => {
      const parts = curves.flatMap((c) => [c, c.over].filter((p) => p && p.low));
      const least = Math.min(...parts.flatMap((p) => p.low.filter((v) => v !== null)));
      const high = Math.max(...parts.flatMap((p) => p.high.filter((v) => v !== null)));
      const low = least > 0 && least < 0.2 * high ? 0 : least; // from zero, where that is near
      const largest = Math.max(Math.abs(low), Math.abs(high)), small = unit && largest > 0 && largest < 0.5;
      const factor = small ? 1000 : 1, number = (v, digits = 3) => short(v * factor, digits);
      return { curves, low, high, unit: small ? `m${unit}` : unit, number,
        labels: Number.isFinite(low) ? [number(high), low < high ? number(low) : ''] : ['', ''] };
    });
  }

  function draw() {
    if (!state || strip.hidden) return;
    [canvas.dataset.begin, canvas.dataset.end] = range();
    const style = getComputedStyle(document.documentElement), ratio = devicePixelRatio || 1;
    const color = (name) => style.getPropertyValue(`--t-color-${name}`).trim();
    const rows = told?.bands || [], panes = groups();
    const height = RULER + rows.length * BAND + panes.length * PANE, width = canvas.clientWidth;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
      canvas.style.height = `${height}px`;
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = '11px system-ui, sans-serif';
    const texts = [...rows.map((row) => row.row), ...panes.flatMap((pane) => [...pane.labels, pane.unit])];
    left = Math.ceil(Math.max(24, ...texts.map((text) => pen.measureText(text).width))) + 10;
    wide = Math.max(1, width - left - 8);
    [canvas.dataset.left, canvas.dataset.wide] = [left, wide];
    ruler(color, height);
    rows.forEach((row, i) => band(row, RULER + i * BAND, color));
    panes.forEach((pane, i) => plot(pane, RULER + rows.length * BAND + i * PANE, color));
    for (const tick of told?.ticks || []) mark(tick, color, height);
    pen.fillStyle = color('text'); // the time that the scene shows
    const here = x(now());
    if (here >= left - 1 && here <= left + wide + 1) {
      pen.fillRect(here - 1, 0, 2, height);
      pen.beginPath(); pen.moveTo(here - 6, 0); pen.lineTo(here + 6, 0); pen.lineTo(here, 8); pen.fill();
    }
    say(color, panes);
  }
  function ruler(color, height) {
    const [a, b] = range(), rough = (b - a) / Math.max(2, wide / 80), power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= rough), digits = Math.max(0, -Math.floor(Math.log10(step)));
    const from = state.is_live ? state.end : 0; // live, times are counted from now
    pen.textAlign = 'center';
    for (let k = Math.ceil((a - from) / step); k * step <= b - from + 1e-9; k++) {
      const place = x(from + k * step), text = sign((k * step).toFixed(digits));
      pen.fillStyle = color('line'); pen.fillRect(place, RULER - 4, 1, height);
      pen.fillStyle = color('muted');
      pen.fillText(k ? text : state.is_live ? 'now' : '0', clamp(place, left + 8, left + wide - 13), 11);
    }
    pen.textAlign = 'left'; pen.fillText('s', 2, 11);
  }
  function band({ row, stretches }, top, color) {
    pen.textAlign = 'left'; pen.fillStyle = color('muted'); pen.fillText(row, 2, top + 11);
    for (const bad of [false, true]) for (const [a, b, text, meaning] of stretches) {
      if ((meaning === 'wrong') !== bad) continue; // what is wrong covers the rest
      const begin = clamp(x(a), left, left + wide), long = Math.max(2, clamp(x(b), left, left + wide) - begin);
      pen.fillStyle = color(meaning); pen.fillRect(begin, top + 1, long, BAND - 2);
      if (pen.measureText(text).width + 6 > long) continue;
      pen.fillStyle = color('ground'); pen.fillText(text, begin + 3, top + 11);
    }
  }
  function mark({ time: when, text, meaning }, color, height) {
    const place = x(when);
    if (place < left || place > left + wide) return;
    pen.fillStyle = color(meaning); pen.fillRect(place - 1, RULER - 6, 2, height);
    const room = Math.max(place - left, left + wide - place) - 6;
    while (text.length > 2 && pen.measureText(text).width > room) text = `${text.slice(0, -2)}…`;
    const long = pen.measureText(text).width, begin = place + long + 6 > left + wide ? place - long - 4 : place + 4;
    pen.textAlign = 'left';
    pen.fillStyle = color('ground'); pen.fillRect(begin - 2, 1, long + 4, RULER - 5);
    pen.fillStyle = color(meaning); pen.fillText(text, begin, 11);
  }
  function plot({ curves, low, high, unit, labels }, top, color) {
    const bottom = top + PANE - 6, size = PANE - 16, span = high - low || 1;
    const y = (value) => (high > low ? bottom - 4 - (value - low) / span * size : top + PANE / 2);
    pen.strokeStyle = color('line'); pen.strokeRect(left + 0.5, top + 4.5, wide, PANE - 8);
    pen.fillStyle = color('muted'); pen.textAlign = 'right';
    pen.fillText(labels[0], left - 4, top + 14); pen.fillText(labels[1], left - 4, bottom);
    pen.fillText(unit, left - 4, top + PANE / 2 + 4);
    pen.save(); pen.beginPath(); pen.rect(left, top, wide, PANE); pen.clip();
    for (const curve of curves) {
      pen.strokeStyle = color(`curve${told.curves.indexOf(curve)}`); pen.lineWidth = 1.5;
      for (const [part, dash] of [[curve, []], [curve.over, [6, 4]]]) if (part?.times) line(part, curve.is_held, y, dash);
    }
    pen.restore();
  }
  function line({ times, low, high }, held, y, dash) {
    pen.setLineDash(dash); pen.beginPath();
    let last = null;
    times.forEach((when, i) => {
      if (when === null || low[i] === null) { last = null; return; }
      const place = x(when), near = last !== null && Math.abs(last - y(high[i])) < Math.abs(last - y(low[i]));
      const [first, second] = near ? [high[i], low[i]] : [low[i], high[i]];
      if (last === null) { pen.moveTo(place, y(first)); pen.lineTo(place + 0.5, y(first)); }
      else { if (held) pen.lineTo(place, last); pen.lineTo(place, y(first)); }
      if (second !== first) pen.lineTo(place, y(second));
      last = y(second);
    });
    if (held && last !== null) pen.lineTo(x(range()[1]), last);
    pen.stroke(); pen.setLineDash([]);
  }
  function value(part, number) { // the last one by the time that is shown
    if (!part?.times) return '';
    const shown = now(); let i = -1;
    for (let k = 0; k < part.times.length && (part.times[k] === null || part.times[k] <= shown); k++) if (part.times[k] !== null) i = k;
    return i < 0 || part.high[i] === null ? '–' : number(part.high[i], 4);
  }
  let key = '';
  function say(color, panes) {
    const shown = now(), live = state.is_live;
    const text = live ? (state.is_past || past !== null ? `PAST: ${(state.end - shown).toFixed(1)} s ago` : 'live')
      : `${shown.toFixed(2)} s of ${state.end.toFixed(2)} s`;
    if (one('output').textContent !== text) one('output').textContent = text;
    one('output').classList.toggle('t-past', live && (state.is_past || past !== null));
    for (const [name, is] of [['valuemin', state.begin], ['valuemax', state.end], ['valuenow', shown.toFixed(2)], ['valuetext', text]])
      canvas.setAttribute(`aria-${name}`, is);
    if (folded) return;
    const meanings = new Map((told?.bands || []).flatMap(({ row, stretches }) => stretches.map(([, , word, meaning]) =>
      [/ ?limit$/.test(row) ? 'held back' : word, meaning])));
    const swatch = (name, kind = '') => { const i = made('i', '', { className: kind });
      i.style[kind ? 'borderColor' : 'background'] = color(name); return i; };
    const entries = [...meanings].map(([word, meaning]) => ['', word, meaning])
      .concat(names.map((name, i) => {
        const pane = panes.find((one) => one.curves.some((c) => c.name === name)), curve = pane?.curves.find((c) => c.name === name);
        const other = curve?.over ? `, dashed ${value(curve.over, pane.number)}` : '';
        return [name, `${name} ${curve?.times ? `${value(curve, pane.number)}${other} ${pane.unit}` : 'is being read …'}`, `curve${i}`]; }));
    if (key === (key = JSON.stringify(entries))) return;
    const focus = document.activeElement?.dataset?.drop;
    one('.t-key').replaceChildren(...entries.map(([name, word, meaning]) => {
      const item = made('span'); item.append(swatch(meaning, name && 't-line'), word);
      if (name) { const drop = made('button', '×', { type: 'button', ariaLabel: `remove ${name}` }); drop.dataset.drop = name; item.append(drop); }
      return item; }));
    if (focus) strip.querySelector(`[data-drop="${CSS.escape(focus)}"]`)?.focus();
  }

  // -- what people do ------------------------------------------------------------------------------

  const fingers = new Map();
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event.offsetX);
    if (fingers.size === 1 && event.offsetX >= left) seek(time(event.offsetX));
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()];
    fingers.set(event.pointerId, event.offsetX);
    if (fingers.size === 1) { seek(time(clamp(event.offsetX, left, left + wide))); return; }
    const after = [...fingers.values()], apart = (places) => Math.max(8, Math.abs(places[0] - places[1]));
    const middle = (places) => (places[0] + places[1]) / 2;
    zoom(apart(before) / apart(after), time(middle(after)));
    pan(time(middle(before)) - time(middle(after)));
  });
  for (const kind of ['pointerup', 'pointercancel']) canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) pan(time(event.deltaX) - time(0));
    else zoom(1.3 ** clamp(event.deltaY / 100, -3, 3), time(event.offsetX));
  }, { passive: false });
  canvas.addEventListener('dblclick', () => show(null));
  canvas.addEventListener('keydown', (event) => {
    const far = event.shiftKey ? 1 : FRAME;
    const does = { ArrowLeft: () => seek(now() - far), ArrowRight: () => seek(now() + far), Home: () => seek(state.begin),
      End: () => (state.is_live ? leave() : seek(state.end)), '+': () => zoom(0.5), '-': () => zoom(2), 0: () => show(null) }[event.key];
    if (!does) return;
    event.preventDefault(); event.stopPropagation(); // else the stylus would step
    if (!state.is_live && state.is_playing) go({ play: 0 });
    does();
  });
  strip.addEventListener('click', ({ target }) => {
    const { do: does, drop } = target.dataset;
    if (drop) { names = names.filter((name) => name !== drop); draw(); look(); canvas.focus(); }
    ({ play: () => go({ play: state.is_playing ? 0 : 1 }), now: leave, in: () => zoom(0.5), out: () => zoom(2), all: () => show(null),
      fold: () => { folded = !folded; take({ ...state, time: now() }); look(); } }[does] || (() => 0))();
  });
  addEventListener('keydown', (event) => {
    const types = event.target.closest?.('input:not([type=checkbox]), textarea, select');
    if (state && !state.is_live && event.key === 'p' && !types && !event.ctrlKey && !event.metaKey) go({ play: state.is_playing ? 0 : 1 });
  });
  speed.append(...[0.1, 0.25, 0.5, 1, 2, 4, 8].map((times) => made('option', `× ${times}`, { value: times })));
  speed.addEventListener('change', () => go({ speed: speed.value }));
  loop.addEventListener('change', () => go({ loop: loop.checked ? 1 : 0 }));
  for (const choice of [over, align]) choice.addEventListener('change', async () => {
    await act('over', [['name', over.value], ['align', align.value]]); look(); });

  function options() {
    list.replaceChildren(...found.map(([name, unit], i) => made('li', `${name}${unit && ` [${unit}]`}`,
      { role: 'option', id: `t-found-${i}`, ariaSelected: String(i === picked) })));
    if (!found.length) list.replaceChildren(made('li', 'no column has these words'));
    list.hidden = false;
    search.setAttribute('aria-expanded', 'true'); search.setAttribute('aria-activedescendant', `t-found-${picked}`);
    list.children[picked]?.scrollIntoView({ block: 'nearest' });
  }
  function close() { list.hidden = true; search.setAttribute('aria-expanded', 'false'); }
  async function find() {
    const [ok, said] = await ask('timeline', [['find', search.value]]);
    if (!ok || document.activeElement !== search) return;
    [found, picked] = [said.found || [], 0]; options();
  }
  function choose(i) {
    if (!found[i]) return;
    if (!names.includes(found[i][0])) names = [...names, found[i][0]].slice(-6);
    search.value = ''; close(); draw(); look();
  }
  for (const kind of ['input', 'focus']) search.addEventListener(kind, find);
  search.addEventListener('blur', () => setTimeout(close, 200));
  list.addEventListener('pointerdown', (event) => { event.preventDefault(); choose([...list.children].indexOf(event.target.closest('li'))); });
  search.addEventListener('keydown', (event) => {
    event.stopPropagation();
    const moves = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (moves) { picked = clamp(picked + moves, 0, found.length - 1); options(); event.preventDefault(); }
    else if (event.key === 'Enter') choose(picked);
    else if (event.key === 'Escape') close();
  });

  // -- again and again -----------------------------------------------------------------------------

  document.documentElement.append(strip);
  addEventListener('DOMContentLoaded', () => { // not on a page of a form's own
    if (document.getElementById('root')) document.body.append(strip); else strip.remove(); });
  let small = narrow();
  addEventListener('resize', () => {
    if (small !== narrow()) folded = small = narrow(); // a phone that is turned, a window made wide
    if (state) { take({ ...state, time: now() }); look(); }
  });
  let choosing = true, seen = 0;
  addEventListener('teleop', ({ detail }) => {
    choosing = detail.chooses;
    if (choosing) take({});
    for (const control of strip.querySelectorAll('[data-do=play], [data-do=now], select, .t-more input[type=checkbox]'))
      control.disabled = !detail.drives;
  });
  const step = () => { if (state?.is_playing && !state.is_live) draw(); requestAnimationFrame(step); };
  requestAnimationFrame(step);
  (async () => {
    for (;;) {
      try {
        if (!choosing) {
          if (state?.is_live && past !== null && !seeking) await go({ seek: past.toFixed(4) });
          else { const [ok, said] = await ask('timeline'); if (ok) take(said); } // unanswered, it stays as it is
          const due = performance.now() - seen > LIVE;
          if (state && (!told || waits() || (state.is_live && !window_ && due))) { seen = performance.now(); look(); }
        }
      } catch { /* the banner says that there is no connection */ }
      await new Promise((done) => setTimeout(done, state ? POLL : 1000));
    }
  })();
})();
