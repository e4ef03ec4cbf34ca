// A bar of votes and a list of raw answers, shared by the evidence and the verdict.

function voteBar(votes, states) {
  const names = [...states, 'invalid'], kinds = ['positive', 'negative', 'invalid'];
  const total = votes.reduce((sum, n) => sum + n, 0);
  const text = votes.map((n, k) => `${n} ${names[k]}`).join(' · ');
  const bar = el('div', {className: 'cd-bar', role: 'img', 'aria-label': `votes: ${text}`},
    ...votes.map((n, k) => {
      const part = el('span', {className: `cd-${kinds[k]}`, title: `${n} ${names[k]}`});
      part.style.flexGrow = total ? n : 0;
      return part;
    }));
  return el('div', {className: 'cd-votes'}, bar, el('small', {}, text));
}

function answerList(answers, open = false) {
  const rows = answers.map(([question, said]) => el('li', {}, el('span', {}, question), el('b', {}, said)));
  const title = `raw answers to ${answers.length} question${answers.length === 1 ? '' : 's'}`;
  return el('details', {className: 'cd-answers', open}, el('summary', {}, title), el('ul', {}, ...rows));
}
