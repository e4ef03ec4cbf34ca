// A line of text that may hold what a user typed, and a bar below it.
// Value: {text, tone: plain | good | warn | bad, share: null or 0 to 1, link: null or {href, text},
// more: null or {title, lines}}.

function build() {
  const {text = '', tone = 'plain', share = null, link = null, more = null} = props.value || {};
  const root = $('.nt'), bar = $('.nt-bar');
  const target = link && el('a', {href: link.href, download: ''}, link.text);
  $('.nt p').replaceChildren(text, ...(target ? [target] : []));
  $('.nt details').hidden = !more;
  $('.nt summary').textContent = more ? more.title : '';
  $('.nt ul').replaceChildren(...(more ? more.lines : []).map((line) => el('li', {}, line)));
  root.dataset.tone = tone;
  root.hidden = !text && !link;
  bar.hidden = share === null;
  bar.firstElementChild.style.width = `${100 * (share || 0)}%`;
}

watch('value', build);
build();
