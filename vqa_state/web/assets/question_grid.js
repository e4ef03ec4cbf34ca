// The live grid of questions. Click or Space switches one off and on; arrows walk.
// Value: {groups: [{title, questions: [{text, on}]}], dropped: [text]}.
// Event 'switched' carries {texts, on}: what was switched, so that two windows do not undo each
// other's.

const groups = $('.qg-groups');
const dropped = $('.qg-dropped');
const buttons = () => [...groups.querySelectorAll('.qg-question')];
const isOn = (button) => button.getAttribute('aria-pressed') === 'true';

function count() {
  const all = buttons(), on = all.filter(isOn).length;
  $('.qg-counts').textContent = all.length
    ? `${on} question${on === 1 ? '' : 's'} will be asked` + (on < all.length ? ` · ${all.length - on} switched off` : '')
    : 'No questions yet: write what the thing is called, and its two states.';
}

function set(changed, on) {
  for (const button of changed) button.setAttribute('aria-pressed', on);
  count();
  trigger('switched', {texts: changed.map((button) => button.dataset.text), on});
}

function question({text, on}) {
  const button = el('button', {
    type: 'button', className: 'qg-question', 'aria-pressed': on, tabIndex: -1, data: {text},
  }, text);
  button.addEventListener('click', () => set([button], !isOn(button)));
  return button;
}

function group({title, questions}) {
  const mine = questions.map(question);
  const all = el('button', {type: 'button', className: 'qg-all'}, 'all on / off');
  all.addEventListener('click', () => set(mine, !mine.every(isOn)));
  return el('section', {'aria-label': title},
    el('header', {}, el('h4', {}, title), all), ...mine);
}

function build() {
  const value = props.value || {}, focus = document.activeElement?.dataset?.text;
  groups.replaceChildren(...(value.groups || []).map(group));
  const all = buttons();
  const at = all.find((button) => button.dataset.text === focus) || all[0];
  if (at) at.tabIndex = 0;
  if (at && focus === at.dataset.text) at.focus({preventScroll: true});
  const doubles = value.dropped || [];
  dropped.hidden = !doubles.length;
  dropped.querySelector('summary').textContent = `${doubles.length} left out: the same text twice is one question`;
  dropped.querySelector('ul').replaceChildren(...doubles.map((text) => el('li', {}, text)));
  element.firstElementChild.dataset.questions = all.length;
  count();
}

groups.addEventListener('focusin', (event) => {
  if (!event.target.matches('.qg-question')) return;
  for (const button of buttons()) button.tabIndex = button === event.target ? 0 : -1;
});
groups.addEventListener('keydown', (event) => {
  const step = {ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1}[event.key];
  const all = buttons(), at = all.indexOf(event.target);
  if (!step || at < 0) return;
  all[at + step]?.focus();
  event.preventDefault();
});

watch('value', build);
build();
