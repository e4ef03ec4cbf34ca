// Adding pictures to the labelling grid: drop or browse, one file after the other so that they
// keep their order. The server tells after every few pictures what became of them; a stop ends the
// request, and the server stops with it. What it refuses is listed with its reason, and so are
// folders that were meant for a label and name no state.

const drop = $('.lg-drop'), picker = drop.querySelector('input');
const going = $('.lg-going'), progress = $('.lg-progress'), stopper = $('.lg-stop');
const news = $('.lg-news'), known = $('.lg-known'), refused = $('.lg-refused'), unnamed = $('.lg-unnamed');
const MOST_LINES = 200;

let waiting = [];   // [{name, file}, ...], or a reason in place of the file
let adding = null;  // while something is added; see `begin`
let halted = null;  // the upload that was stopped, until the grid is read anew

function say(text) {
  news.textContent = text;
}

function begin() {
  return {
    stop: new AbortController(), began: performance.now(), before: new Set(items.map((item) => item.id)),
    n: 0, bytes: 0,   // files and bytes that are through
    added: 0, known: [], refused: [], unlabelled: [], ended: '',
  };
}

async function sendAll() {
  if (adding) return;
  adding = begin();
  show(null);
  // A drop may come before the page knows its project: the value arrives just after the page.
  while (!project) await new Promise((done) => setTimeout(done, 50));
  while (waiting.length && !adding.ended) await sendNext(waiting.shift());
  const done = adding;
  waiting = [];
  adding = null;
  show(done);
  if (done.stop.signal.aborted) {
    halted = done;   // the server may be at its last few pictures, of which no line came
    setTimeout(() => trigger('reload', {}), 300);
  } else trigger('uploaded', {});
}

async function sendNext({name, file, reason}) {
  const limit = props.value.max_bytes;
  try {
    if (reason) throw new Error(reason);
    if (file.size > limit) throw new Error(`larger than ${Math.round(limit / 1e6)} MB`);
    move(file, 0, 0);
    await send(name, file);
  } catch (error) {
    if (adding.stop.signal.aborted) adding.ended = 'Stopped';
    else if (error instanceof Lost) adding.ended = 'The app cannot be reached; start it again';
    else adding.refused.push({name, reason: error.message});
  }
  adding.n += 1;
  adding.bytes += file ? file.size : 0;
}

class Lost extends Error {}

const orLost = (promise) => promise.catch((error) => { throw error.name === 'AbortError' ? error : new Lost(); });

async function send(name, file) {
  await file.slice(0, 1).arrayBuffer().catch(() => { throw new Error('it cannot be read; is it still there?'); });
  const url = `/projects/${project}/upload?name=${encodeURIComponent(name)}`;
  const reply = await orLost(fetch(url, {method: 'POST', body: file, signal: adding.stop.signal}));
  if (!reply.ok) {
    const {error} = await reply.json().catch(() => ({}));
    throw new Error(error || `the server answered ${reply.status}`);
  }
  for await (const line of linesOf(reply.body.pipeThrough(new TextDecoderStream()))) note(file, JSON.parse(line));
}

async function* linesOf(stream) {
  const reader = stream.getReader();
  let rest = '';
  for (let part; !(part = await orLost(reader.read())).done;) {
    const lines = (rest + part.value).split('\n');
    rest = lines.pop();
    yield* lines;
  }
}

/** What the server tells after a few pictures. */
function note(file, told) {
  append(told.added);
  told.known.forEach(({row}) => renew(row));
  adding.added += told.added.length;
  adding.known.push(...told.known.map(({name, row}) => ({name, reason: row.name === name ? '' : `it is ${row.name}`})));
  adding.refused.push(...told.refused);
  adding.unlabelled.push(...told.unlabelled);
  move(file, told.done, told.of);
}

// ---- telling -------------------------------------------------------------------------------

/** The bar, how many are through, and how long the rest takes by the pace so far. */
function move(file, done, of) {
  const files = adding.n + 1 + waiting.length;
  const bytes = adding.bytes + file.size + waiting.reduce((sum, one) => sum + (one.file ? one.file.size : 0), 0);
  const share = (adding.bytes + (of ? done / of : 0) * file.size) / Math.max(1, bytes);
  if (share) progress.value = share;
  const seconds = (performance.now() - adding.began) / 1000, left = seconds * (1 - share) / share;
  const where = files === 1 ? (of ? `Reading ${done} of ${of}` : 'Sending…')
    : `Reading ${adding.n + 1} of ${files}${of > 1 ? `: ${done} of ${of}` : ''}`;
  say(where + (seconds > 1 && share > 0.02 && share < 1 ? ` · about ${time(left)} left` : ''));
}

function time(seconds) {
  return seconds < 90 ? `${Math.max(1, Math.round(seconds))} s` : `${Math.round(seconds / 60)} min`;
}

/** What became of an upload that is over, or the bar while there is none to show. */
function show(over) {
  going.hidden = Boolean(over);
  stopper.disabled = false;
  progress.removeAttribute('value');
  const {added = 0, known: old = [], refused: bad = [], unlabelled = [], ended = ''} = over || {};
  const bare = stillBare(unlabelled), folders = reasonsOf(bare);
  say(!over ? 'Reading…' : [
    (ended ? `${ended}: ` : '') + `${added} added` + (ended ? '; drop the same files again to go on' : ''),
    old.length ? `${old.length} already there` : '',
    bad.length ? `${bad.length} refused${bare.length ? '' : ':'}` : '',
    bare.length ? `${bare.length} without a label yet: label ${bare.length === 1 ? 'it' : 'them'} below with keys 1 and 2` : '',
  ].filter(Boolean).join(' · '));
  known.hidden = !old.length;
  known.querySelector('summary').textContent = `Which ${old.length === 1 ? 'one was' : `${old.length} were`} already there`;
  known.querySelector('ul').replaceChildren(...named(old));
  refused.hidden = !bad.length;
  refused.replaceChildren(...named(bad));
  unnamed.hidden = !folders.length;
  unnamed.replaceChildren(...named(folders));
}

/** Those that have no label now, each once: others got one by hand or by a later file. */
function stillBare(unlabelled) {
  const bare = new Set(items.filter((item) => item.label === null).map((item) => item.id));
  return unlabelled.filter((one) => bare.delete(one.id));
}

/** Why they have none, by folder; nothing where no folder was meant to label, which is no news. */
function reasonsOf(bare) {
  if (!bare.some((one) => one.folder)) return [];
  const counts = new Map();
  for (const {reason} of bare) counts.set(reason, (counts.get(reason) || 0) + 1);
  return [...counts].map(([reason, n]) => ({name: `${n} without a label`, reason}));
}

function named(list) {
  const lines = list.slice(0, MOST_LINES).map(({name, reason}) =>
    el('li', {}, el('b', {}, name), reason ? ` – ${reason}` : ''));
  if (list.length > MOST_LINES) lines.push(el('li', {}, `and ${list.length - MOST_LINES} more`));
  return lines;
}

/** The grid was read anew: count what an upload that was stopped has really added. */
function recount() {
  if (!halted || adding) return;
  halted.added = items.filter((item) => !halted.before.has(item.id)).length;
  show(halted);
  halted = null;
}

// ---- taking --------------------------------------------------------------------------------

function take(found) {
  if (!found.length) { if (!adding) say('There is no file in it.'); return; }
  waiting.push(...found);
  sendAll();
}

const loose = (files) => [...files].map((file) => ({name: file.name, file}));

/** The files of a drop. Those in folders carry their path, which may name a state and a side. */
async function dropped(transfer) {
  // All that the browser gives away is gone after the event, so it is taken before any waiting.
  const files = loose(transfer.files);
  const entries = [...transfer.items].filter((one) => one.kind === 'file').map((one) => one.webkitGetAsEntry());
  if (!entries.some((entry) => entry && entry.isDirectory)) return files;
  const found = [];
  for (const entry of entries) if (entry) await walk(entry, found);
  return found;
}

async function walk(entry, found) {
  const name = entry.fullPath.replace(/^\/+/, '');
  try {
    if (entry.isFile) found.push({name, file: await new Promise((yes, no) => entry.file(yes, no))});
    else for (const one of await inside(entry)) await walk(one, found);
  } catch (error) { found.push({name, reason: `it cannot be read (${error.message})`}); }
}

/** All entries of a folder, by name; the browser gives a hundred at a time. */
async function inside(folder) {
  const reader = folder.createReader(), all = [];
  for (let some; (some = await new Promise((yes, no) => reader.readEntries(yes, no))).length;) all.push(...some);
  return all.sort((one, other) => one.name.localeCompare(other.name, undefined, {numeric: true}));
}

const holdsFiles = (event) => event.dataTransfer && event.dataTransfer.types.includes('Files');
const zone = $('.lg');   // all of it: who drops on the grid means the same

zone.addEventListener('dragover', (event) => {
  if (!holdsFiles(event)) return;
  event.preventDefault();
  drop.classList.add('lg-over');
});
zone.addEventListener('dragleave', (event) => {
  if (!zone.contains(event.relatedTarget)) drop.classList.remove('lg-over');
});
zone.addEventListener('drop', async (event) => {
  if (!holdsFiles(event)) return;
  event.preventDefault();
  drop.classList.remove('lg-over');
  take(await dropped(event.dataTransfer));
});
// Beside it, the browser would open the file in the place of this page.
for (const kind of ['dragover', 'drop']) {
  document.addEventListener(kind, (event) => {
    if (event.defaultPrevented || !holdsFiles(event)) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = 'none';
  });
}

stopper.addEventListener('click', () => {
  if (!adding) return;
  stopper.disabled = true;
  waiting = [];
  adding.ended = 'Stopped';
  adding.stop.abort();
});
$('.lg-browse').addEventListener('click', () => picker.click());
picker.addEventListener('change', () => { if (picker.files.length) take(loose(picker.files)); picker.value = ''; });
window.addEventListener('beforeunload', (event) => {
  if (adding || saving) event.preventDefault();   // the browser asks whether to leave
});
