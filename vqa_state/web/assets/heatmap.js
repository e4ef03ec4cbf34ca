// One cell a question: how often its valid answers are right on the training images, and how many
// answers were invalid. Click or Enter picks a question; arrow keys walk.
// Value: {columns: [text], rows: [{title, cells: [{question, accuracy, invalid} or null]}], picked}.

const table = $('table');

function cell(content) {
  if (content === null) return el('td', {className: 'hm-none'});
  const {question, accuracy, invalid} = content;
  const spoken = `${question} ${accuracy === null ? 'no valid answer' : `${percent(accuracy)} % right`},`
    + ` ${percent(invalid)} % invalid`;
  const button = el('button', {type: 'button', title: spoken, 'aria-label': spoken, tabIndex: -1, data: {question}},
    el('b', {}, percent(accuracy)), el('small', {}, invalid ? `${percent(invalid)} % invalid` : ' '));
  button.addEventListener('click', () => pick(button));
  const node = el('td', {className: invalid > 0.2 ? 'hm-invalid' : ''}, button);
  node.style.setProperty('--share', accuracy === null ? 0.5 : Math.max(0, (accuracy - 0.5) * 2));
  return node;
}

function mark(question) {
  for (const button of table.querySelectorAll('button')) {
    button.setAttribute('aria-pressed', button.dataset.question === question);
  }
}

function pick(button) {
  mark(button.dataset.question);
  trigger('pick', {question: button.dataset.question});
}

function build() {
  const {columns = [], rows = [], picked = ''} = props.value || {};
  const head = el('tr', {}, el('td'), ...columns.map((text) => el('th', {scope: 'col'}, text)));
  const body = rows.map(({title, cells}) =>
    el('tr', {}, el('th', {scope: 'row'}, title), ...cells.map(cell)));
  table.replaceChildren(el('thead', {}, ...(columns.length ? [head] : [])), el('tbody', {}, ...body));
  const first = table.querySelector('button');
  if (first) first.tabIndex = 0;
  mark(picked);
  element.firstElementChild.hidden = !rows.length;
}

table.addEventListener('focusin', (event) => {
  for (const button of table.querySelectorAll('button')) button.tabIndex = button === event.target ? 0 : -1;
});
table.addEventListener('keydown', (event) => {
  const step = {ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0]}[event.key];
  const at = event.target.closest('td');
  if (!step || !at) return;
  const row = table.rows[at.parentElement.rowIndex + step[0]];
  row?.cells[at.cellIndex + step[1]]?.querySelector('button')?.focus();
  event.preventDefault();
});

watch('value', build);
build();
