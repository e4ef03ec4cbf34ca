// Adding pictures to the labelling grid: drop or browse, one file after the other so that they
// keep their order; what the server refuses is listed with its reason.

const drop = $('.lg-drop'), picker = drop.querySelector('input');
const progress = $('.lg-progress'), news = $('.lg-news'), refused = $('.lg-refused');
let uploading = Promise.resolve();

function say(text) {
  news.textContent = text;
}

async function sendFile(file, tally) {
  const limit = props.value.max_bytes;
  if (file.size > limit) throw new Error(`larger than ${Math.round(limit / 1e6)} MB`);
  const report = await post(`/projects/${project}/upload?name=${encodeURIComponent(file.name)}`, file);
  append(report.added);
  tally.added += report.added.length;
  tally.known += report.known.length;
  tally.refused.push(...report.refused);
}

async function sendAll(files) {
  // A drop may come before the page knows its project: the value arrives just after the page.
  while (!project) await new Promise((done) => setTimeout(done, 50));
  const tally = {added: 0, known: 0, refused: []};
  progress.hidden = false;
  for (const [done, file] of files.entries()) {
    progress.value = done / files.length;
    say(`Reading ${done + 1} of ${files.length}…`);
    try { await sendFile(file, tally); }
    catch (error) { tally.refused.push({name: file.name, reason: error.message}); }
  }
  progress.hidden = true;
  tell(tally);
  trigger('uploaded', {});
}

function tell({added, known, refused: bad}) {
  say([
    `${added} added`, known ? `${known} already there` : '', bad.length ? `${bad.length} refused:` : '',
  ].filter(Boolean).join(' · '));
  refused.hidden = !bad.length;
  refused.replaceChildren(...bad.map(({name, reason}) => el('li', {}, el('b', {}, name), ` – ${reason}`)));
}

function take(files) {
  const list = [...files];   // the browser empties its own list when the event is over
  if (list.length) uploading = uploading.then(() => sendAll(list));
}

drop.addEventListener('dragover', (event) => { event.preventDefault(); drop.classList.add('lg-over'); });
drop.addEventListener('dragleave', () => drop.classList.remove('lg-over'));
drop.addEventListener('drop', (event) => {
  event.preventDefault();
  drop.classList.remove('lg-over');
  take(event.dataTransfer.files);
});
$('.lg-browse').addEventListener('click', () => picker.click());
picker.addEventListener('change', () => { take(picker.files); picker.value = ''; });
