// The pages of a study with people: the participant's lies over viser's page, the other is whole.
(() => {
  'use strict';
  const conducts = location.pathname === '/conduct', key = decodeURIComponent(location.hash.slice(1));
  const page = document.createElement('main');
  page.id = 't-start';
  const made = (kind, text = '', more = {}) => Object.assign(document.createElement(kind), { textContent: text }, more);
  const button = (text, act, more = {}) => {
    const one = made('button', text, { type: 'button', ...more });
    one.addEventListener('click', () => act(one));
    return one;
  };
  const one = (selector) => page.querySelector(selector);
  const write = (element, text) => { if (element.textContent !== text) element.textContent = text; };

  async function ask(path, words = {}) {
    let isOk = false, told = 'The console does not answer. Try again.';
    try {
      const answer = await fetch(`${path}?${new URLSearchParams(words)}`, {
        headers: { 'Teleop-Page': window.teleopPage || 'new' }, cache: 'no-store', signal: AbortSignal.timeout(10000) });
      [isOk, told] = [answer.ok, await answer.json()];
    } catch { /* it is told below */ }
    write(one('.t-why'), isOk ? '' : told);
    return isOk ? told : null;
  }

  // -- the participant ------------------------------------------------------------------------

  const bar = made('div', '', { id: 't-trial', hidden: true }), told = made('span');
  told.setAttribute('role', 'status');
  const BUTTONS = { consent: 'I agree and take part', begin: 'Begin', questions: 'Go on' };
  const SAYS = {
    wait: 'Please wait for the person who conducts the study.',
    paused: 'A break. It goes on when the person who conducts the study says so.',
    thanks: 'That was all. Thank you for taking part!',
  };
  let shown = '', drives = false, changed = () => {}, acted = 0; // an answer to what was asked before an act is old

  function scale({ name, text, low, high }) {
    const field = made('fieldset', '', { className: 't-scale' }), row = made('div'), input = made('input');
    Object.assign(input, { type: 'range', min: 0, max: 100, step: 5, value: 50, name, className: 't-open' });
    input.setAttribute('aria-label', `${text} From ${low} to ${high}.`);
    for (const kind of ['input', 'pointerdown', 'keydown']) {
      input.addEventListener(kind, (event) => {
        if (event.key === 'Tab' || event.key === 'Shift') return;
        input.classList.remove('t-open'); changed();
      });
    }
    row.append(made('span', low), input, made('span', high));
    field.append(made('legend', text), row);
    return field;
  }

  function participant(now) {
    const { step, title, text, trial, trials, is_practice: practice, tried, attempts, questions } = now;
    const at = trial === undefined ? '' : String(trial), runs = step === 'runs';
    const place = at && `Trial ${trial} of ${trials}${practice ? ' · practice' : ''}`;
    document.documentElement.classList.add('t-people');
    bar.hidden = !runs;
    if (runs) write(told, `${place}${attempts ? ` · ${Math.min(tried, attempts)} of ${attempts} done` : ''}`);
    if (shown === step + at) return;
    shown = step + at;
    if (runs) { write(bar.querySelector('p'), text); bar.querySelector('button').disabled = false; }
    const go = button(BUTTONS[step], async () => {
      go.disabled = true;
      const words = questions ? Object.fromEntries([...page.querySelectorAll('input')].map((e) => [e.name, e.value])) : {};
      acted += 1;
      const next = await ask('go', { step, at, ...words });
      acted += 1;
      changed();
      if (next) participant(next);
    }, { id: 't-begin' });
    const hint = made('p', '', { className: 't-muted' });
    changed = () => {
      const open = page.querySelectorAll('.t-open').length;
      go.disabled = open > 0 || !drives;
      write(hint, open ? `${questions.length - open} of ${questions.length} scales are set` : '');
    };
    one('.t-body').replaceChildren(...[
      made('h1', title), place && !runs && made('h2', place),
      made('p', SAYS[step] || (questions ? 'Please set each scale to what suits the trials just done best.' : text),
        { className: 't-text' }),
      ...(questions || []).map(scale),
      questions && hint, BUTTONS[step] && go].filter(Boolean));
    changed();
    page.scrollTop = 0;
    one('.t-text').tabIndex = -1;
    announce();
  }

  // A screen reader says what has the focus. A page that is hidden or moved loses it, so it is given again.
  const announce = () => one('.t-text')?.focus();

  // -- who conducts ---------------------------------------------------------------------------

  const act = async (what, words = {}) => { if (await ask('act', { key, what, ...words })) await look(); };

  function trialRow(trial, names, now) {
    const row = made('tr'), judged = made('td'), { number } = trial;
    const say = (what) => {
      const reason = prompt(`Why is trial ${number} ${what === 'skip' ? 'skipped' : 'repeated'}?`);
      if (reason) act(what, { trial: number, reason });
    };
    const runs = now.step === 'runs' && now.trial === number;
    if (!runs) {
      judged.append(button('Repeat', () => say('repeat'), { ariaLabel: `Repeat trial ${number}`, disabled: !trial.state }),
        button('Skip', () => say('skip'), { ariaLabel: `Skip trial ${number}` }));
    }
    const values = Object.entries(trial.values).map(([name, value]) => `${name} ${value}`).join(', ');
    const state = runs ? '▶ runs' : { done: '✓ done', skipped: '– skipped', failed: '! failed', again: '↻ again' }[trial.state] || '';
    const number4 = (value) => (typeof value === 'number' ? value.toPrecision(4) : '');
    row.append(...[`${number}${trial.is_practice ? ' practice' : ''}`, values, state, ...names.map((name) => number4(trial[name])),
      [trial.verdict, trial.reason].filter(Boolean).join(' · ')].map((text) => made('td', text)), judged);
    return row;
  }

  function conductor(now) {
    const { title, participant: code, step, trial, tried, attempts, is_paused: paused, everybody, own, metrics } = now;
    write(one('h1'), title);
    write(one('.t-now'), `${code}: ${step}${trial ? `, trial ${trial} of ${own.length}` : ''}`
      + (step === 'runs' && attempts ? `, ${tried} of ${attempts} attempts` : '') + (paused ? ' · PAUSED' : ''));
    write(one('.t-pause'), paused ? 'Go on' : 'Pause');
    one('.t-pause').dataset.what = paused ? 'go_on' : 'pause';
    one('.t-over').disabled = step !== 'runs';
    const said = JSON.stringify([code, step, trial, own, everybody]);
    if (shown === said) return;
    shown = said;
    one('select').replaceChildren(...everybody.map((e) => made('option', `${e.code} – ${e.done} of ${e.trials}`, { value: e.code })));
    one('select').value = code;
    one('select').disabled = step === 'runs';
    const heads = ['Trial', 'Condition', 'State', ...metrics, 'Verdict', ''].map((text) => made('th', text, { scope: 'col' }));
    one('thead').replaceChildren(...heads);
    one('tbody').replaceChildren(...own.map((row) => trialRow(row, metrics, now)));
  }

  async function table() {
    const text = await ask('table', { key });
    if (text === null) return;
    const link = made('a', '', { href: URL.createObjectURL(new Blob([text], { type: 'text/csv' })), download: 'people.csv' });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  async function look() {
    const before = acted;
    const now = await ask(conducts ? 'conducting' : 'people', conducts ? { key } : {});
    if (now && acted === before) (conducts ? conductor : participant)(now);
  }

  if (conducts) {
    document.documentElement.classList.add('t-choosing');
    page.innerHTML = `<h1></h1><p class="t-now" role="status"></p><p class="t-why" role="alert"></p>
      <section class="t-acts"><label>Participant <select></select></label>
      <button type="button" class="t-pause"></button><button type="button" class="t-over">End this trial</button>
      <button type="button" class="t-table">Export as CSV</button></section>
      <section class="t-trials" tabindex="0" aria-label="trials"><table><thead></thead><tbody></tbody></table></section>`;
    one('select').addEventListener('change', ({ target }) => act('choose', { participant: target.value }));
    one('.t-pause').addEventListener('click', ({ target }) => act(target.dataset.what));
    one('.t-over').addEventListener('click', () => act('end'));
    one('.t-table').addEventListener('click', table);
  } else {
    page.innerHTML = '<section class="t-body"></section><p class="t-watch" role="status"></p><p class="t-why" role="alert"></p>';
    const over = button('End this trial', async () => { over.disabled = true; await ask('go', { step: 'runs', at: shown.slice(4) }); });
    bar.append(told, made('p'), over);
    document.documentElement.append(bar);
    addEventListener('teleop', ({ detail }) => {
      const wasHidden = page.hidden;
      page.hidden = !detail.chooses;
      if (wasHidden && detail.chooses) announce();
      drives = Boolean(detail.drives && window.teleopPage);
      changed();
      document.documentElement.classList.toggle('t-choosing', detail.chooses);
      const watch = window.teleopPage && !detail.drives ? 'Another page is the participant’s. ' : '';
      if (one('.t-watch').dataset.said === watch) return;
      one('.t-watch').dataset.said = watch;
      one('.t-watch').replaceChildren(watch, ...(watch ? [button('Take control', () => ask('go', { step: 'take' }))] : []));
    });
  }
  document.documentElement.append(page);
  addEventListener('DOMContentLoaded', () => { document.body.append(page, bar); announce(); });
  (async () => { for (;;) { await look(); await new Promise((done) => setTimeout(done, 700)); } })();
})();
