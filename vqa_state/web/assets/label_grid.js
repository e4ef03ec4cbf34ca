// The labelling grid: pick images by mouse or keys, label them, move on at once.
// Value: {project, states: [positive, negative], max_bytes, items: [{id, name, label, split}]},
// with a label of 1, -1 or null, a split of train, test, unused or null, and accepted: the label was
// a suggestion; and suggested: {id: {label, sureness}} for images without a label, which become
// training images if accepted.
// What is seen is changed first and saved behind: fast keying never waits for the network.

const grid = $('.lg-grid'), tools = $('.lg-tools'), counts = $('.lg-counts'), zoom = $('.lg-zoom');

let project = '', states = ['', ''], items = [];
let suggested = {};       // by id
let cells = [];           // one option per item, in the same order
let chosen = new Set();   // positions of the selected items
let anchor = 0, cursor = 0;
let history = [];         // [[{field, before: [[id, value], ...]}, ...], ...], a list for each step

// ---- drawing -------------------------------------------------------------------------------

function stateName(label) {
  return label === 1 ? states[0] : label === -1 ? states[1] : 'no label';
}

function paint(at) {
  const item = items[at], cell = cells[at];
  if (!cell) return;
  const hint = suggestion(item);
  const shown = hint ? hint.label : item.label;
  cell.dataset.label = shown === null ? 'none' : shown > 0 ? 'positive' : 'negative';
  cell.dataset.suggested = Boolean(hint);
  cell.dataset.split = item.split || 'none';
  cell.setAttribute('aria-selected', chosen.has(at));
  const guess = hint ? `${stateName(hint.label)} is suggested, ${percent(hint.sureness)} % sure` : '';
  cell.title = guess;
  cell.setAttribute('aria-label', `${item.name}: ${guess || stateName(item.label)}, ${item.split || 'no side yet'}`);
  cell.classList.toggle('lg-cursor', at === cursor);
  const word = hint ? `${stateName(shown)}?` : item.label === null ? '–' : stateName(item.label);
  const sure = hint ? ` ${percent(hint.sureness)} %` : '';
  cell.querySelector('.lg-label').replaceChildren(el('b', {}, word), sure);
  cell.querySelector('.lg-split').textContent = item.split || '';
}

/** What is suggested for an image that still has no label. */
function suggestion(item) {
  return item.label === null ? suggested[item.id] : undefined;
}

function count() {
  const of = (field, value) => items.filter((item) => item[field] === value).length;
  const undecided = items.filter((item) => item.label !== null && item.split === null).length;
  counts.textContent = !items.length ? '' : [
    `${of('label', 1)} ${states[0]}`, `${of('label', -1)} ${states[1]}`, `${of('label', null)} to label`,
    `${of('split', 'train')} train`, `${of('split', 'test')} test`, `${of('split', 'unused')} unused`,
    undecided ? `${undecided} on no side yet` : '',
    items.some(suggestion) ? `${items.filter(suggestion).length} suggested` : '', `${chosen.size} selected`,
  ].filter(Boolean).join(' · ');
}

function makeCell(item, at) {
  const picture = el('img', {
    src: `/projects/${project}/thumbs/${item.id}`, alt: '', title: item.name,
    loading: 'lazy', decoding: 'async', draggable: false,
  });
  const cell = el('div', {className: 'lg-cell', role: 'option', id: `lg-${at}`, data: {at, id: item.id}},
    picture, el('div', {}, el('span', {className: 'lg-label'}), el('span', {className: 'lg-split'})));
  return cell;
}

function append(fresh) {
  const first = items.length;
  items.push(...fresh);
  fresh.forEach((item, k) => cells.push(makeCell(item, first + k)));
  grid.append(...cells.slice(first));
  fresh.forEach((_, k) => paint(first + k));
  element.firstElementChild.dataset.images = items.length;
  count();
}

/** What the server says of an image that is here already; what was marked meanwhile stays. */
function renew(row) {
  const at = items.findIndex((item) => item.id === row.id);
  if (at < 0) return;
  Object.assign(items[at], row, marksOf(row.id));
  paint(at);
  count();
}

function build() {
  const value = props.value || {};
  const kept = value.project === project ? new Set([...chosen].map((at) => items[at].id)) : new Set();
  const at = value.project === project ? cursor : 0;
  project = value.project || '';
  states = value.states || ['', ''];
  suggested = value.suggested || {};
  items = [];
  cells = [];
  history = [];
  grid.replaceChildren();
  append((value.items || []).map((item) => ({...item, ...marksOf(item.id)})));
  drawTools();
  chosen = new Set([...items.keys()].filter((k) => kept.has(items[k].id)));
  cursor = anchor = Math.max(0, Math.min(at, items.length - 1));
  items.forEach((_, k) => paint(k));
  $('.lg').hidden = !project;
  const first = items.findIndex(suggestion);
  if (first >= 0 && !chosen.size) {  // what is to be accepted must be seen
    cursor = anchor = first;
    grid.scrollTop = cells[first].offsetTop - grid.offsetTop;
  }
  count();
  recount();
}

function drawTools() {
  const button = (text, key, act, className) => {
    const node = el('button', {type: 'button', className, title: key ? `key ${key}` : ''}, text);
    node.addEventListener('click', () => { act(); grid.focus({preventScroll: true}); });
    return node;
  };
  const group = (label, ...buttons) =>
    el('span', {className: 'lg-group', role: 'group', 'aria-label': label}, el('span', {}, label), ...buttons);
  tools.replaceChildren(
    group('Label',
      button(states[0], '1', () => mark('label', 1), 'lg-positive'),
      button(states[1], '2', () => mark('label', -1), 'lg-negative'),
      button('clear', '0', () => mark('label', null)),
      ...(items.some(suggestion) ? [button('accept suggested', 'Y', accept)] : [])),
    group('Use for',
      button('train', 'T', () => mark('split', 'train')),
      button('test', 'E', () => mark('split', 'test')),
      button('unused', 'U', () => mark('split', 'unused'))),
    group('', button('undo', 'Ctrl+Z', undo), button('remove…', 'Delete', remove)));
}

// ---- selecting -----------------------------------------------------------------------------

function select(next) {
  const before = chosen;
  chosen = next;
  for (const at of new Set([...before, ...next])) if (before.has(at) !== next.has(at)) paint(at);
  count();
}

function moveTo(at, {extend = false, toggle = false} = {}) {
  if (!items.length) return;
  const before = cursor;
  cursor = Math.max(0, Math.min(items.length - 1, at));
  if (extend) {
    const [low, high] = [Math.min(anchor, cursor), Math.max(anchor, cursor)];
    select(new Set(Array.from({length: high - low + 1}, (_, k) => low + k)));
  } else if (toggle) {
    anchor = cursor;
    const next = new Set(chosen);
    if (!next.delete(cursor)) next.add(cursor);
    select(next);
  } else {
    anchor = cursor;
    select(new Set([cursor]));
  }
  paint(before);
  paint(cursor);
  grid.setAttribute('aria-activedescendant', `lg-${cursor}`);
  cells[cursor].scrollIntoView({block: 'nearest'});
}

// ---- marking and saving --------------------------------------------------------------------

function mark(field, value) {
  if (!chosen.size) return;
  const at = [...chosen].sort((a, b) => a - b);
  const all = (given) => new Map(at.map((k) => [items[k].id, given]));
  const step = [change(field, all(value))];
  if (field === 'label') step.push(change('accepted', all(false)));
  history.push(step);
  save();
  if (field === 'label' && value !== null && at.length === 1) advance(at[0]);
}

/** On to the next image without a label, after `at` first, then from the beginning. */
function advance(at) {
  const order = [...items.keys()];
  const next = [...order.slice(at + 1), ...order.slice(0, at)].find((k) => items[k].label === null);
  if (next !== undefined) moveTo(next);
}

/** The selected images get the labels that are suggested for them, and teach from now on. */
function accept() {
  const at = [...chosen].filter((k) => suggestion(items[k])).sort((a, b) => a - b);
  if (!at.length) return;
  const labels = new Map(at.map((k) => [items[k].id, suggestion(items[k]).label]));
  const sides = new Map(at.map((k) => [items[k].id, 'train']));
  const yes = new Map(at.map((k) => [items[k].id, true]));
  history.push([change('label', labels), change('accepted', yes), change('split', sides)]);
  save();  // both at once: no label that came from a vote may ever get to the test side
  if (at.length === 1) advance(at[0]);
}

function undo() {
  for (const {field, before} of (history.pop() || []).reverse()) change(field, new Map(before));
  save();
}

/** Change a field of some images, to be saved; what undoes it. */
function change(field, values) {
  const before = [];
  items.forEach((item, at) => {
    if (!values.has(item.id)) return;
    before.push([item.id, item[field]]);
    item[field] = values.get(item.id);
    paint(at);
  });
  count();
  for (const [id, value] of before) if (!unsaved[field].has(id)) unsaved.seen[field].set(id, value);
  for (const [id, value] of values) unsaved[field].set(id, value);
  return {field, before};
}

const FIELDS = ['label', 'accepted', 'split'];
const empty = () => Object.fromEntries(FIELDS.map((field) => [field, new Map()]));
const noMarks = () => ({...empty(), seen: empty()});  // and what stood here before each mark
let unsaved = noMarks();
let onTheWay = unsaved;   // the batch that is being saved
let saving = false;

/** What was marked here and the server may not know yet. */
function marksOf(id) {
  const marks = {};
  for (const batch of [onTheWay, unsaved]) {
    for (const field of FIELDS) if (batch[field].has(id)) marks[field] = batch[field].get(id);
  }
  return marks;
}

function warn(text) {
  $('.lg-unsaved').textContent = text;
}

/** One save at a time; what was marked meanwhile goes with the next one. */
async function save() {
  if (saving) return;
  saving = true;
  while (FIELDS.some((field) => unsaved[field].size)) {
    const batch = onTheWay = unsaved;
    unsaved = noMarks();
    try {
      const {refused} = await post(`/projects/${project}/marks`, JSON.stringify({
        labels: Object.fromEntries(batch.label), accepted: Object.fromEntries(batch.accepted),
        splits: Object.fromEntries(batch.split),
        seen: {
          labels: Object.fromEntries(batch.seen.label), splits: Object.fromEntries(batch.seen.split),
        },
      }));
      if (refused) { warn(`Not saved: ${refused}`); trigger('reload', {}); } else warn('');
    } catch (error) {
      if (error.refused) { warn(`Not saved: ${error.message}`); trigger('reload', {}); continue; }
      for (const field of FIELDS) {
        for (const [id, value] of batch[field]) if (!unsaved[field].has(id)) unsaved[field].set(id, value);
        for (const [id, value] of batch.seen[field]) unsaved.seen[field].set(id, value);
      }
      warn('Not saved yet: the server cannot be reached. Trying again…');
      await new Promise((done) => setTimeout(done, 1000));
    }
  }
  saving = false;
  onTheWay = unsaved;
  trigger('changed', {});
}

async function remove() {
  const ids = [...chosen].map((at) => items[at].id);
  if (!ids.length || !window.confirm(`Remove ${ids.length} image(s) from the project?`)) return;
  try {
    await post(`/projects/${project}/remove`, JSON.stringify({ids}));
    chosen = new Set();
  } catch (error) { warn(`Not removed: ${error.message}`); }
  trigger('reload', {});
}

function enlarge() {
  const item = items[cursor];
  if (!item) return;
  zoom.querySelector('img').src = `/projects/${project}/images/${item.id}`;
  zoom.querySelector('img').alt = item.name;
  zoom.querySelector('p').textContent = `${item.name} · ${stateName(item.label)} · ${item.split || 'no side yet'}`;
  zoom.showModal();
}

// ---- mouse and keys ------------------------------------------------------------------------

grid.addEventListener('click', (event) => {
  const cell = event.target.closest('.lg-cell');
  if (!cell) return;
  grid.focus({preventScroll: true});
  moveTo(Number(cell.dataset.at), {extend: event.shiftKey, toggle: event.ctrlKey || event.metaKey});
});
grid.addEventListener('dblclick', enlarge);
grid.addEventListener('focus', () => { if (!chosen.size) moveTo(cursor); });
zoom.addEventListener('click', () => zoom.close());

const KEYS = {
  1: () => mark('label', 1), 2: () => mark('label', -1), 0: () => mark('label', null),
  Backspace: () => mark('label', null), t: () => mark('split', 'train'), e: () => mark('split', 'test'),
  u: () => mark('split', 'unused'), y: accept, Delete: remove, Enter: enlarge,
};
const CONTROL_KEYS = {a: () => select(new Set(items.keys())), z: undo};

grid.addEventListener('keydown', (event) => {
  const columns = getComputedStyle(grid).gridTemplateColumns.split(' ').length;
  const step = {
    ArrowRight: 1, ArrowLeft: -1, ArrowDown: columns, ArrowUp: -columns, Home: -items.length, End: items.length,
  }[event.key];
  const act = (event.ctrlKey || event.metaKey ? CONTROL_KEYS : KEYS)[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (step) moveTo(cursor + step, {extend: event.shiftKey});
  else if (act) act();
  else return;
  event.preventDefault();
});

watch('value', build);
build();
