// The emergency stop and the banner of every page, and its signs of life.
//
// They are elements of their own on top of viser's: in view from the first byte, whatever is loaded,
// scrolled or folded, and they speak to the server by requests of their own.
(() => {
  'use strict';
  const PERIOD = 500, AGAIN = 200, TRIES = 50, PIXELS = 320000; // ms, ms, number, of a scene that software draws
  let connected = true, pressed = false, shown = { can_stop: true, doing: 'starting …' };

  // Where software draws, each sample of each pixel costs time that a session may need: edges are not smoothed, flat
  // drawings are left to the processor, a large scene has fewer pixels, and nothing shines through it: it has the
  // ground that viser lays behind it.
  const canvas = HTMLCanvasElement.prototype, context = canvas.getContext;
  const trial = context.call(document.createElement('canvas'), 'webgl2');
  const named = trial?.getExtension('WEBGL_debug_renderer_info');
  const soft = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(named && trial.getParameter(named.UNMASKED_RENDERER_WEBGL));
  trial?.getExtension('WEBGL_lose_context')?.loseContext();
  let ground = [1, 1, 1];
  function clear(mask) {
    this.clearColor(...ground, 1);
    WebGL2RenderingContext.prototype.clear.call(this, mask);
  }
  if (soft) {
    canvas.getContext = function (kind, wanted) {
      if (kind === '2d') return context.call(this, kind, { ...wanted, willReadFrequently: true });
      const drawing = context.call(this, kind, { ...wanted, antialias: false, alpha: false });
      return drawing && Object.assign(drawing, { clear });
    };
  }
  function thin() { // again and again: viser takes another ratio at any time; ?fixedDpr=1 in the address keeps one
    const behind = window.__viserMutable?.backgroundMaterial; // the picture of a camera in place of the scene
    if (behind) behind.visible = Boolean(behind.uniforms?.enabled?.value); // without one it is not drawn
    const color = getComputedStyle(document.documentElement).getPropertyValue('--t-color-scene').trim();
    if (color) ground = [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16) / 255);
    for (const notice of document.querySelectorAll('.mantine-Notification-root')) // the page adapts to it, see above
      if (notice.textContent.includes('Software WebGL')) notice.querySelector('button')?.click();
    const settings = soft && !location.search.includes('fixedDpr') && window.__viserTestpoints?.devSettings;
    if (settings) settings.set({ fixedDpr: Math.min(1, Math.max(0.35, Math.sqrt(PIXELS / (innerWidth * innerHeight)))) });
  }

  const ask = (path, more = {}) => fetch(path, {
    headers: { 'Teleop-Page': window.teleopPage || 'new', ...more }, cache: 'no-store',
    signal: AbortSignal.timeout(2000),
  });
  const wait = (time) => new Promise((done) => setTimeout(done, time));

  const safety = document.createElement('div');
  const stop = document.createElement('button');
  const banner = document.createElement('div');
  const starting = document.createElement('div');
  safety.id = 't-safety';
  starting.id = 't-starting';
  stop.id = 't-stop'; stop.textContent = 'EMERGENCY STOP';
  stop.title = 'stops all arms at once; the space key too';
  banner.id = 't-banner'; banner.setAttribute('role', 'alert');
  starting.setAttribute('role', 'status');
  stop.setAttribute('aria-keyshortcuts', 'Space');
  const spoken = document.createElement('p'); // what a screen reader says of the arms
  spoken.className = 't-spoken'; spoken.setAttribute('role', 'status');
  const hand = document.createElement('button');
  hand.id = 't-press'; hand.type = 'button'; hand.textContent = 'Press or grip (hold J)'; hand.hidden = true;
  safety.append(hand, stop);

  function show() {
    const [head, text] = pressed === 'unheard'
      ? ['STOP NOT CONFIRMED', 'The console does not answer. Use the emergency stop of the machine.']
      : pressed === 'early' ? ['EMERGENCY STOP', 'No arm is there yet. It is stopped as soon as it is.']
      : !connected ? ['NO CONNECTION', `What you see is old.${shown.can_stop ? ' The arm holds while nobody drives.' : ''}`]
      : shown.is_stopped || pressed ? ['EMERGENCY STOP', shown.text || 'All arms are being stopped.']
      : ['', ''];
    const root = document.documentElement.classList;
    thin();
    dispatchEvent(new CustomEvent('teleop', { detail: shown })); // the form hears of it
    root.toggle('t-stopped', Boolean(shown.is_stopped || pressed));
    root.toggle('t-says', head !== '');
    if (banner.dataset.said !== head + text) {
      banner.dataset.said = head + text;
      const strong = document.createElement('b');
      strong.textContent = head;
      banner.replaceChildren(strong, text);
    }
    if (spoken.textContent !== (shown.state || '')) spoken.textContent = shown.state || '';
    stop.hidden = !shown.can_stop;
    hand.hidden = !shown.can_press || !shown.drives;
    for (const take of document.querySelectorAll('button')) // of viser's panel, which is the same for all pages
      if (take.textContent === 'Take control') take.disabled = Boolean(shown.drives);
    const loads = shown.doing || (window.teleopPage || shown.chooses ? '' : 'loading the scene …');
    starting.textContent = loads; // it lies over viser's empty scene until viser has connected
    starting.hidden = !loads;
    const seen = document.querySelector('canvas')?.getBoundingClientRect();
    if (seen) banner.style.width = `${seen.width}px`; // the panel beside it stays in view
  }

  async function press() {
    if (!shown.can_stop || pressed) return;
    pressed = true;
    show();
    const name = crypto.getRandomValues(new Uint32Array(2)).join('-'); // said again, it is one press
    for (let i = 0; i < TRIES || pressed === 'early'; i++) {
      try {
        const answer = await ask('stop', { 'Teleop-Press': name });
        if (answer.ok) { await look(); break; }
        if (answer.status === 409) pressed = 'early'; // nothing is there to stop yet
      } catch { if (i >= 4) pressed = 'unheard'; }
      show();
      await wait(AGAIN);
    }
    pressed = false;
    show();
  }

  let asked = 0, heard = 0; // an answer that comes after a later one is old
  async function look() {
    const number = asked += 1;
    let said = null;
    try { said = await (await ask('alive')).json(); } catch { /* nobody answers */ }
    if (number < heard) return;
    heard = number;
    connected = said !== null;
    shown = said || shown;
    show();
  }

  // The hand closes for as long as the button or the key is down, one request after the other.
  let closed = false, said = Promise.resolve();
  function close(now) {
    if (now === closed || (now && hand.hidden)) return;
    closed = now;
    hand.setAttribute('aria-pressed', closed);
    said = said.then(() => ask(`jaw?closed=${Number(now)}`)).catch(() => {});
  }

  const types = (element) => element.closest && element.closest(
    'input:not([type=checkbox]):not([type=radio]):not([type=range]), textarea, [contenteditable=true]');
  document.documentElement.append(banner, safety, starting, spoken); // before the page has a body
  show();
  let isDown = false; // the click that ends a press with mouse or finger is not another one
  stop.addEventListener('pointerdown', () => { isDown = true; press(); });
  stop.addEventListener('click', (event) => { if (!isDown || !event.detail) press(); isDown = false; });
  hand.addEventListener('pointerdown', (event) => { hand.setPointerCapture(event.pointerId); close(true); });
  for (const kind of ['pointerup', 'pointercancel']) hand.addEventListener(kind, () => close(false));
  addEventListener('blur', () => close(false));
  addEventListener('keydown', (event) => {
    if ((event.code === 'KeyJ' && !types(event.target)) || (event.code === 'Enter' && event.target === hand)) close(true);
  });
  addEventListener('keyup', (event) => { if (['KeyJ', 'Enter'].includes(event.code)) close(false); });
  addEventListener('keydown', (event) => {
    if (event.code !== 'Space' || types(event.target) || !shown.can_stop) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat) press();
  }, true);
  addEventListener('keyup', (event) => { // a focused button would take it for a click
    if (event.code === 'Space' && !types(event.target) && shown.can_stop) event.preventDefault();
  }, true);
  addEventListener('DOMContentLoaded', () => document.body.append(banner, safety, starting));
  look();
  setInterval(look, PERIOD); // whether or not the last one was answered: it is the sign of life
})();
