// Helpers that every widget shares. Text reaches the page through textContent only, so nothing
// that a user typed is ever parsed as HTML.

const $ = (selector) => element.querySelector(selector);

function el(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name === 'data') Object.assign(node.dataset, value);
    else if (name in node) node[name] = value;
    else node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null));
  return node;
}

function percent(share) {
  return share === null ? '–' : `${Math.round(share * 100)}`;
}

/** POST to the app's own route; a refusal becomes an Error that carries the server's sentence. */
async function post(url, body) {
  const reply = await fetch(url, {method: 'POST', body});
  const data = await reply.json().catch(() => ({}));
  if (reply.ok) return data;
  const error = new Error(data.error || `the server answered ${reply.status}`);
  error.refused = reply.status < 500;
  throw error;
}
