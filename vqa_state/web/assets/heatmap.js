// One cell a question: how often its valid answers are right on the training images, and how many
// answers were invalid, and how many of these the length limit cut off. Own questions stand in a table of their own, with the state that "yes"
// means. Click or Enter picks a question; arrow keys walk.
// Value: {columns: [text], rows: [{title, cells: [{question, accuracy, invalid, cut_off} or null]}],
// own: [{title, yes, cell}], picked}.

const root = $('.hm'), [grid, ownTable] = element.querySelectorAll('table');

function cell(content) {
  if (content === null) return el('td', {className: 'hm-none'});
  const {question, accuracy, invalid, cut_off: cutOff} = content;
  const spoken = `${question} ${accuracy === null ? 'no valid answer' : `${percent(accuracy)} % right`},`
    + ` ${percent(invalid)} % invalid${cutOff ? `, ${percent(cutOff)} % cut off` : ''}`;
  const small = cutOff ? `${percent(invalid)} % invalid · ${percent(cutOff)} % cut off` : `${percent(invalid)} % invalid`;
  const button = el('button', {type: 'button', title: spoken, 'aria-label': spoken, tabIndex: -1, data: {question}},
    el('b', {}, percent(accuracy)), el('small', {}, invalid ? small : ' '));
  button.addEventListener('click', () => pick(button));
  const node = el('td', {className: invalid > 0.2 ? 'hm-invalid' : ''}, button);
  node.style.setProperty('--share', accuracy === null ? 0.5 : Math.max(0, (accuracy - 0.5) * 2));
  return node;
}

function mark(question) {
  for (const button of root.querySelectorAll('button')) {
    button.setAttribute('aria-pressed', button.dataset.question === question);
  }
}

function pick(button) {
  mark(button.dataset.question);
  trigger('pick', {question: button.dataset.question});
}

function titled(title, ...cells) {
  return el('tr', {}, el('th', {scope: 'row'}, title), ...cells);
}

function fill(table, corner, columns, rows) {
  const head = el('tr', {}, el('th', {scope: 'col'}, corner),
    ...columns.map((text) => el('th', {scope: 'col'}, text)));
  table.replaceChildren(el('thead', {}, head), el('tbody', {}, ...rows));
  table.hidden = !rows.length;
}

function build() {
  const {columns = [], rows = [], own = [], picked = ''} = props.value || {};
  fill(grid, '', columns, rows.map(({title, cells}) => titled(title, ...cells.map(cell))));
  fill(ownTable, 'your own questions', ['yes means', 'right'],
    own.map(({title, yes, cell: one}) => titled(title, el('td', {className: 'hm-yes'}, yes), cell(one))));
  const first = root.querySelector('button');
  if (first) first.tabIndex = 0;
  mark(picked);
  root.hidden = !first;
}

root.addEventListener('focusin', (event) => {
  for (const button of root.querySelectorAll('button')) button.tabIndex = button === event.target ? 0 : -1;
});
root.addEventListener('keydown', (event) => {
  const step = {ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0]}[event.key];
  const at = event.target.closest('td');
  if (!step || !at) return;
  const rows = [...root.querySelectorAll('tr')].filter((row) => row.querySelector('button'));
  const row = rows[rows.indexOf(at.parentElement) + step[0]];
  const button = row?.cells[at.cellIndex + step[1]]?.querySelector('button');
  (button || (step[0] ? row?.querySelector('button') : null))?.focus();
  event.preventDefault();
});

watch('value', build);
build();
