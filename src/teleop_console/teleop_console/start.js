// The form on which a session is chosen, begun and ended; it lies over viser's page while nothing
// runs, and all that it says are requests of its own.
(() => {
  'use strict';
  const page = document.createElement('main');
  page.id = 't-start';
  page.hidden = true;
  page.innerHTML = `
    <h1>Teleoperation console</h1>
    <p class="t-watch" role="status"></p><p class="t-loads" role="status">Loading the form …</p>
    <section aria-labelledby="t-choose"><h2 id="t-choose">New session</h2><div class="t-fields"></div></section>
    <section aria-labelledby="t-recorded"><h2 id="t-recorded">Recordings</h2>
      <p class="t-muted t-none"></p><ul class="t-list"></ul>
      <p class="t-acts">
        <button type="button" data-act="replay">Replay</button>
        <button type="button" data-act="score">Score</button>
        <button type="button" data-act="export">Export as CSV</button>
        <span class="t-muted t-hint"></span></p>
      <pre class="t-told" tabindex="0" role="status" aria-label="what the command said" hidden></pre></section>
    <footer><p class="t-why" role="alert"></p>
      <div><button type="button" id="t-begin" disabled>Start</button>
      <code class="t-command" aria-label="the same on the command line"></code>
      <button type="button" class="t-copy">Copy</button></div></footer>`;
  const end = document.createElement('button');
  end.id = 't-end'; end.type = 'button'; end.hidden = true;
  const one = (selector) => page.querySelector(selector);
  const made = (kind, text = '', more = {}) => Object.assign(document.createElement(kind), { textContent: text }, more);
  const fields = {}, picked = new Set();
  let followed, tip, chosen = null, drives = false, open = false, busy = false, shownList = '';

  async function ask(path, words = [], body) {
    try {
      const answer = await fetch(`${path}?${new URLSearchParams(words)}`, {
        ...(body && { method: 'POST', body }),
        headers: { 'Teleop-Page': window.teleopPage || 'new' }, cache: 'no-store',
        signal: AbortSignal.timeout(path === 'begin' ? 30000 : 10000) }); // a xacro may take 20 s
      return [answer.ok, await answer.json()];
    } catch { return [false, 'The console does not answer. Try again.']; }
  }

  function field({ name, label, options }) {
    const row = made('label', label, { className: 't-field' });
    const select = made('select', '', { name });
    const why = made('span', '', { className: 't-why' });
    select.addEventListener('change', () => choose(name, select.value));
    row.append(select, why);
    one('.t-fields').append(row);
    if (name === 'robot') { // with a file of one's own, and the link at its tip
      const own = made('label', 'Its URDF', { className: 't-field' });
      const file = made('input', '', { type: 'file', accept: '.urdf' });
      file.addEventListener('change', () => keep(file.files[0]));
      own.append(file); one('.t-fields').append(own);
      tip = text('tip', 'Tip', 'link of the URDF at its tip');
      tip.links = made('datalist', '', { id: 't-tips' }); tip.row.append(tip.links);
      tip.input.setAttribute('list', 't-tips');
    }
    if (name === 'operator') followed = text('followed', 'Follows', 'recording or CSV file on this machine');
    return fields[name] = { select, why, known: '' };
  }

  // A line of text beside the words: the file that an operator follows, a URDF's link at the tip.
  function text(name, label, hint) {
    const row = made('label', label, { className: 't-field' });
    const input = made('input', '', { placeholder: hint, type: 'text', maxLength: 500 });
    input.addEventListener('change', () => choose(name, input.value.trim()));
    row.append(input);
    one('.t-fields').append(row);
    return { row, input };
  }

  function choose(name, word) {
    chosen = { ...chosen, [name]: word };
    if (name === 'robot') forgetTip();
    one('#t-begin').disabled = true; // until the answer says that these words go together
    one('footer .t-why').textContent = 'checking …';
    look();
  }

  function forgetTip() { // it is a link of the former robot
    delete chosen.tip;
    tip.input.value = '';
  }

  function show(told) {
    if (!chosen || !drives) chosen = told.chosen; // words count only from the page that drives
    if (document.activeElement !== tip?.input && tip) tip.input.value = chosen.tip || '';
    one('.t-loads').hidden = true;
    for (const given of told.fields) {
      const { name, options } = given, known = fields[name] || field(given), said = JSON.stringify(options);
      if (known.known !== said) {
        known.known = said;
        known.select.replaceChildren(...options.map(({ word, text, reason }) => made('option',
          (word && text ? `${word} – ${text}` : word || text) + (reason ? ` ✕ ${reason}` : ''),
          { value: word, disabled: Boolean(reason) && word !== (chosen[name] || ''), title: reason || '' })));
      }
      known.select.value = chosen[name] || '';
      known.select.disabled = !drives;
    }
    followed.row.hidden = !['bag', 'file'].includes(chosen.operator);
    tip.row.hidden = !/[./]/.test(chosen.robot || '');
    tip.links.replaceChildren(...told.tips.map((value) => made('option', '', { value })));
    one('.t-command').textContent = told.command;
    one('footer .t-why').textContent = told.refusal && `Cannot start: ${told.refusal}`;
    one('#t-begin').disabled = Boolean(told.refusal) || !drives;
    one('#t-begin').textContent = told.is_repeat ? 'Repeat' : 'Start';
    one('.t-told').hidden = !told.told;
    if (one('.t-told').textContent !== told.told) one('.t-told').textContent = told.told;
    busy = told.is_busy;
    list(told);
  }

  function list({ recordings, folder }) {
    one('.t-none').textContent = recordings.length ? '' : `None in ${folder} yet: a session that ends is listed here.`;
    const said = JSON.stringify(recordings);
    if (said !== shownList) {
      shownList = said;
      one('.t-list').replaceChildren(...recordings.map(({ name, made: at, about, verdict, is_good }) => {
        const item = made('li'), row = made('label'), box = made('input', '', { type: 'checkbox', checked: picked.has(name) });
        box.addEventListener('keydown', ({ key }) => { if (key === 'Enter') box.click(); }); // space is the stop
        box.addEventListener('change', () => { picked[box.checked ? 'add' : 'delete'](name); acts(); });
        const mark = is_good === null ? ['idle', '…', 'being scored'] : is_good ? ['good', '✓', verdict] : ['held', '!', verdict];
        const text = made('span');
        text.append(made('b', name), made('span', ` ${new Date(1000 * at).toLocaleString()} ${about && '· ' + about}`, { className: 't-muted' }),
          made('br'), made('span', `${mark[1]} ${mark[2]}`, { className: `t-${mark[0]}` }));
        row.append(box, text); item.append(row);
        return item;
      }));
    }
    acts();
  }

  function acts() {
    const count = picked.size;
    one('[data-act=replay]').disabled = one('[data-act=export]').disabled = count !== 1 || !drives || busy;
    one('[data-act=score]').disabled = !count || !drives || busy;
    one('[data-act=score]').textContent = count > 1 ? 'Compare' : 'Score';
    one('.t-hint').textContent = count ? '' : 'Tick one (by keys: Enter), or several to compare.';
  }

  async function look() {
    const asked = JSON.stringify(chosen);
    const [ok, told] = await ask('start', chosen ? Object.entries(chosen) : []);
    if (!ok || !told.fields) return false;
    if (asked === JSON.stringify(chosen)) show(told);
    return told.fields.some((f) => f.options.some((o) => o.reason === null));
  }

  async function act(path, words) {
    const [ok, told] = await ask(path, words);
    if (!ok) one('footer .t-why').textContent = told;
    else if (path === 'begin' || path === 'show') {
      one('#t-begin').disabled = true; // the page follows in a moment
      one('footer .t-why').textContent = 'starting …';
    }
    else if (path === 'run') await look();
  }

  async function keep(file) { // a URDF that was chosen or dropped is the robot
    if (!file) return;
    const [ok, told] = await ask('robot', [['name', file.name]], file);
    if (ok) { chosen = { ...chosen, robot: told }; forgetTip(); await look(); }
    else one('footer .t-why').textContent = told;
  }
  for (const kind of ['dragover', 'drop']) page.addEventListener(kind, (event) => event.preventDefault());
  page.addEventListener('drop', ({ dataTransfer }) => keep(dataTransfer.files[0]));

  one('#t-begin').addEventListener('click', () => act('begin', Object.entries(chosen)));
  one('.t-copy').addEventListener('click', async () => {
    await navigator.clipboard.writeText(one('.t-command').textContent);
    one('.t-copy').textContent = 'Copied';
    setTimeout(() => { one('.t-copy').textContent = 'Copy'; }, 2000);
  });
  page.addEventListener('click', ({ target }) => {
    const names = [...picked].map((name) => ['name', name]), kind = target.dataset?.act;
    if (kind === 'replay') act('show', names);
    else if (kind) act('run', [['kind', kind], ...names]);
  });
  end.addEventListener('click', () => { end.disabled = true; ask('end'); });
  one('.t-watch').addEventListener('click', ({ target }) => { if (target.matches('button')) ask('take'); });

  addEventListener('teleop', ({ detail }) => {
    drives = detail.drives;
    end.hidden = !detail.can_end || !drives;
    if (end.hidden) end.disabled = false;
    end.textContent = detail.can_stop ? 'End session' : 'Back to all sessions';
    const watch = window.teleopPage && !drives ? 'You watch: another page has control. ' : '';
    if (one('.t-watch').dataset.said !== watch) {
      one('.t-watch').dataset.said = watch;
      one('.t-watch').replaceChildren(watch, ...(watch ? [made('button', 'Take control', { type: 'button' })] : []));
    }
    document.documentElement.classList.toggle('t-choosing', detail.chooses);
    page.hidden = !detail.chooses;
    if (detail.chooses && !open) {
      open = true;
      picked.clear(); shownList = ''; one('.t-list').replaceChildren();
      (async () => {
        while (open) {
          const more = await look().catch(() => false);
          await new Promise((done) => setTimeout(done, more ? 50 : 1000));
        }
      })();
    }
    open = detail.chooses;
  });
  document.documentElement.append(page);
  document.querySelector('#t-safety').prepend(end);
  addEventListener('DOMContentLoaded', () => document.body.append(page));
})();
