// Images with how the questions voted on them and what the model said, word for word.
// Value: {project, states, title, cards: [{image, title, note, votes: [+, -, invalid],
// answers: [[question, said]]}], chosen: whether the reader has just asked for it}.

function card({image, title, note, votes, answers}, {project, states}) {
  return el('article', {},
    el('img', {src: `/projects/${project}/thumbs/${image}`, alt: title, loading: 'lazy'}),
    el('div', {}, el('b', {title}, title), el('span', {className: 'ev-note'}, note),
      answers.length ? voteBar(votes, states) : null),
    said(answers));
}

function said(answers) {
  if (!answers.length) return null; // judged without questions
  return answers.length === 1 ? el('p', {className: 'ev-said'}, answers[0][1]) : answerList(answers);
}

function build() {
  const value = props.value || {}, cards = value.cards || [];
  $('.ev').hidden = !value.title;
  $('.ev-title').textContent = value.title || '';
  $('.ev-cards').replaceChildren(...cards.map((one) => card(one, value)));
}

watch('value', () => {
  build();
  if (props.value?.chosen) $('.ev-title').scrollIntoView({block: 'nearest'});
});
build();
