// What accuracy costs: points to choose by click, or by arrow keys and Enter.
// Value: {x, y: titles, x_range, y_range: [low, high], points: [{x, y, low, high: interval or
// missing, marked: not on the line, says, lines: [text]}]}, points by rising x; or {empty: what to
// do first}; event `pick` carries {at}.

const SVG = 'http://www.w3.org/2000/svg';
const WIDTH = 480, HEIGHT = 240, LEFT = 40, RIGHT = 14, TOP = 26, BOTTOM = 38;
const chart = $('svg');

function svg(tag, attributes, text = '') {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.textContent = text;
  return node;
}

function scales({x_range: [x0, x1], y_range: [y0, y1]}) {
  const part = (value, low, high) => (value - low) / (high - low || 1);
  return [
    (value) => LEFT + part(value, x0, x1) * (WIDTH - LEFT - RIGHT),
    (value) => HEIGHT - BOTTOM - part(value, y0, y1) * (HEIGHT - TOP - BOTTOM),
  ];
}

function axes({x, y, x_range, y_range}) {
  const low = HEIGHT - BOTTOM, right = WIDTH - RIGHT;
  return [
    svg('rect', {class: 'tr-frame', x: LEFT, y: TOP, width: right - LEFT, height: low - TOP}),
    svg('text', {x: LEFT, y: TOP - 10}, y),
    svg('text', {x: (LEFT + right) / 2, y: HEIGHT - 6, 'text-anchor': 'middle'}, x),
    svg('text', {x: LEFT - 6, y: TOP + 10, 'text-anchor': 'end'}, y_range[1]),
    svg('text', {x: LEFT - 6, y: low, 'text-anchor': 'end'}, y_range[0]),
    svg('text', {x: LEFT, y: low + 15}, x_range[0]),
    svg('text', {x: right, y: low + 15, 'text-anchor': 'end'}, x_range[1]),
  ];
}

function dot({says, marked}, at, cx, cy) {
  const node = svg('circle', {cx, cy, r: marked ? 9 : 6, class: marked ? 'tr-marked' : '', role: 'button', tabindex: at ? -1 : 0,
    'aria-label': says, 'aria-pressed': false});
  node.addEventListener('click', () => pick(at));
  return node;
}

function dots() { return [...chart.querySelectorAll('circle')]; }

function pick(at) {
  const {says, lines} = props.value.points[at];
  show(at);
  $('.tr-says').textContent = says;
  $('ul').replaceChildren(...lines.map((line) => el('li', {}, line)));
  trigger('pick', {at});
}

function show(at) {
  dots().forEach((node, k) => {
    node.setAttribute('aria-pressed', k === at);
    node.setAttribute('tabindex', k === Math.max(at, 0) ? 0 : -1);
  });
}

function build() {
  const value = props.value || {}, points = value.points || [];
  $('.tr').hidden = !points.length && !value.empty;
  $('.tr-says').textContent = value.empty || '';
  chart.replaceChildren();
  $('ul').replaceChildren();
  if (!points.length) return;
  const [x, y] = scales(value);
  chart.setAttribute('viewBox', `0 0 ${WIDTH} ${HEIGHT}`);
  chart.setAttribute('aria-label', `${value.y} against ${value.x}`);
  const intervals = points.filter((one) => one.low !== undefined).map((one) =>
    svg('line', {class: 'tr-interval', x1: x(one.x), x2: x(one.x), y1: y(one.low), y2: y(one.high)}));
  const line = points.filter((one) => !one.marked).map((one) => `${x(one.x).toFixed(1)},${y(one.y).toFixed(1)}`).join(' ');
  chart.append(...axes(value), ...intervals, svg('polyline', {points: line}),
    ...points.map((one, at) => dot(one, at, x(one.x), y(one.y))));
  const rings = points.some((one) => one.marked) ? ' Rings are the sets in the table.' : '';
  $('.tr-says').textContent = `Choose a point: click it, or use the arrow keys and Enter.${rings}`;
}

chart.addEventListener('keydown', (event) => {
  const all = dots(), at = all.indexOf(event.target);
  const step = {ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1}[event.key];
  if (at < 0) return;
  if (step) all[at + step]?.focus();
  else if (event.key === 'Enter' || event.key === ' ') pick(at);
  else return;
  event.preventDefault();
});

watch('value', build);
build();
