// Try a recognizer on a picture: drop or browse, see the verdict, its votes and its answers.
// Value: {project, objective, query: how it counts, or missing} where one can be dropped, {verdict} or {failure} for a camera.

const drop = $('.vd-drop'), picker = $('.vd-drop input'), news = $('.vd-news');
const result = $('.vd-result'), said = $('.vd-said'), picture = $('.vd-result img');

function draw(verdict, url) {
  result.hidden = !verdict;
  if (!verdict) return;
  picture.hidden = !url;
  if (url) picture.src = url;
  said.replaceChildren(
    el('strong', {className: 'vd-state', data: {state: verdict.state}}, verdict.state_name),
    el('span', {className: 'vd-why'}, verdict.reason),
    voteBar(verdict.votes, verdict.states),
    el('span', {className: 'vd-why'}, `${verdict.n_calls} calls${verdict.n_skipped ? ` (${verdict.n_skipped} saved)` : ''} · ${verdict.milliseconds} ms`),
    answerList(verdict.answers, verdict.answers.length <= 8));
}

async function recognize(file) {
  const {project, objective, query = ''} = props.value;
  news.textContent = `Looking at ${file.name}…`;
  draw(null);
  try {
    const verdict = await post(`/projects/${project}/recognize/${encodeURIComponent(objective)}${query}`, file);
    URL.revokeObjectURL(picture.src);
    draw(verdict, URL.createObjectURL(file));
    news.textContent = file.name;
  } catch (error) { news.textContent = error.message; }
}

function build() {
  const {verdict = null, failure = '', project = ''} = props.value || {};
  drop.hidden = !project;   // a camera's verdict, or no recognizer yet
  news.textContent = failure;
  draw(verdict, '');
}

drop.addEventListener('dragover', (event) => { event.preventDefault(); drop.classList.add('vd-over'); });
drop.addEventListener('dragleave', () => drop.classList.remove('vd-over'));
drop.addEventListener('drop', (event) => {
  event.preventDefault();
  drop.classList.remove('vd-over');
  if (event.dataTransfer.files.length) recognize(event.dataTransfer.files[0]);
});
drop.querySelector('button').addEventListener('click', () => picker.click());
picker.addEventListener('change', () => { if (picker.files.length) recognize(picker.files[0]); picker.value = ''; });

watch('value', build);
build();
