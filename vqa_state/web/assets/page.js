() => {
  // gradio's text boxes tell their `input` event of key presses only; a paste, a cut or a deletion
  // changes the text without one. So such a change is followed by a key press that types nothing.
  let pressed = false;
  document.addEventListener('keypress', (event) => { pressed = event.isTrusted; }, true);
  document.addEventListener('input', (event) => {
    if (event.target.matches('textarea') && !pressed) {
      event.target.dispatchEvent(new KeyboardEvent('keypress', {bubbles: true}));
    }
    pressed = false;
  });

  // Its sliders tell that they were released by a pointer only; the keys let go as well.
  const moving = ['Arrow', 'Page', 'Home', 'End'];
  document.addEventListener('keyup', ({target, key}) => {
    if (target.matches('input[type="range"]') && moving.some((one) => key.startsWith(one))) {
      target.dispatchEvent(new PointerEvent('pointerup', {bubbles: true}));
    }
  });
}
