// Best and mean fitness, generation by generation: one small chart for each objective.
// Value: {searches: [{name, title, hint, total, points: [[generation, best, mean]], terms: [[name, value]]}]}.

const SVG = 'http://www.w3.org/2000/svg';
const WIDTH = 300, HEIGHT = 150, LEFT = 52, BOTTOM = 18, TOP = 8, RIGHT = 8;

function svg(tag, attributes, text = '') {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.textContent = text;
  return node;
}

function panel({name, title, hint}) {
  const chart = svg('svg', {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img'});
  chart.append(
    svg('rect', {class: 'sc-frame', x: LEFT, y: TOP, width: WIDTH - LEFT - RIGHT, height: HEIGHT - TOP - BOTTOM}),
    svg('text', {class: 'sc-high', x: LEFT - 6, y: TOP + 9, 'text-anchor': 'end'}),
    svg('text', {class: 'sc-low', x: LEFT - 6, y: HEIGHT - BOTTOM, 'text-anchor': 'end'}),
    svg('text', {x: LEFT, y: HEIGHT - 4}, '0'),
    svg('text', {class: 'sc-last', x: WIDTH - RIGHT, y: HEIGHT - 4, 'text-anchor': 'end'}),
    svg('polyline', {class: 'sc-mean'}), svg('polyline', {class: 'sc-best'}));
  return el('figure', {data: {name}},
    el('figcaption', {}, el('b', {}, title), el('span', {}, hint)), chart,
    el('p', {className: 'sc-now'}), el('dl', {}));
}

function draw(figure, {title, total, points, terms}) {
  const find = (selector) => figure.querySelector(selector);
  // The first generations are far below the rest: the scale follows what has been seen.
  const seen = points.flatMap(([, best, mean]) => [best, mean]);
  const low = Math.min(...seen), high = Math.max(...seen), span = high - low || 1;
  const x = (generation) => LEFT + (generation / Math.max(total, 1)) * (WIDTH - LEFT - RIGHT);
  const y = (fitness) => TOP + (1 - (fitness - low) / span) * (HEIGHT - TOP - BOTTOM);
  const line = (k) => points.map((point) => `${x(point[0]).toFixed(1)},${y(point[k]).toFixed(1)}`).join(' ');
  find('.sc-best').setAttribute('points', line(1));
  find('.sc-mean').setAttribute('points', line(2));
  const digits = span < 1 ? 3 : 1;
  find('.sc-high').textContent = points.length ? high.toFixed(digits) : '';
  find('.sc-low').textContent = points.length ? low.toFixed(digits) : '';
  find('.sc-last').textContent = total || '';
  const last = points[points.length - 1];   // the legend is in the words: solid best, dashed mean
  find('.sc-now').textContent = last
    ? `best ${last[1].toFixed(3)} · mean ${last[2].toFixed(3)}`
    : 'not started';
  find('svg').setAttribute('aria-label', last ? `${title}: generation ${last[0]} of ${total}, ${find('.sc-now').textContent}` : title);
  find('dl').replaceChildren(...terms.flatMap(([term, value]) => [el('dt', {}, term), el('dd', {}, value)]));
  figure.dataset.generation = last ? last[0] : '';
}

function build() {
  const searches = (props.value || {}).searches || [], root = element.firstElementChild;
  const names = searches.map((search) => search.name).join();
  if (root.dataset.names !== names) {
    root.replaceChildren(...searches.map(panel));
    root.dataset.names = names;
  }
  searches.forEach((search, at) => draw(root.children[at], search));
}

watch('value', build);
build();
