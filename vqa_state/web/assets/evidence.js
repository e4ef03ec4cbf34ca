// Images with how the questions voted on them and what the model said, word for word.
// Value: {project, states, title, cards: [{image, title, note, votes: [+, -, invalid],
// answers: [[question, said]]}]}.

function card({image, title, note, votes, answers}, {project, states}) {
  return el('article', {},
    el('img', {src: `/projects/${project}/thumbs/${image}`, alt: title, loading: 'lazy'}),
    el('div', {}, el('b', {title}, title), el('span', {className: 'ev-note'}, note), voteBar(votes, states)),
    answers.length === 1 ? el('p', {className: 'ev-said'}, answers[0][1]) : answerList(answers));
}

function build() {
  const value = props.value || {}, cards = value.cards || [];
  $('.ev').hidden = !value.title;
  $('.ev-title').textContent = value.title || '';
  $('.ev-cards').replaceChildren(...cards.map((one) => card(one, value)));
}

watch('value', build);
build();
