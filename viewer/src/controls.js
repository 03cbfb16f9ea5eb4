// Small builders for the panel: everything is made with text nodes, so no text from a file can become markup.
export function element(tag, attributes = {}, ...children) {
  const e = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) e.addEventListener(name.slice(2), value);
    else if (name in e && name !== 'style' && name !== 'list') e[name] = value;
    else e.setAttribute(name, value);
  }
  e.append(...children);
  return e;
}

export function checkbox(label, checked, swatch, count, onchange) {
  const input = element('input', { type: 'checkbox', checked, onchange: (e) => onchange(e.target.checked) });
  const row = element('label', { className: 'row' }, input);
  if (swatch) row.append(element('span', { className: 'swatch', style: `background:${swatch}` }));
  row.append(element('span', { className: 'grow' }, label));
  if (count !== undefined) row.append(element('span', { className: 'count' }, String(count)));
  return { row, input };
}

export function slider(label, min, max, step, value, format, oninput) {
  const output = element('output', {}, format(value));
  const input = element('input', {
    type: 'range', min, max, step, value, ariaLabel: label,
    oninput: (e) => { output.textContent = format(+e.target.value); oninput(+e.target.value); },
  });
  const row = element('label', { className: 'slider' }, element('span', { className: 'grow' }, label), output, input);
  return { row, input, set: (v) => { input.value = v; output.textContent = format(v); } };
}

export function select(label, options, value, onchange) {
  const input = element('select', { ariaLabel: label, onchange: (e) => onchange(e.target.value) });
  for (const [key, text] of options) input.append(element('option', { value: key, selected: key === value }, text));
  return { row: element('label', { className: 'row' }, element('span', { className: 'grow' }, label), input), input };
}

export function segmented(options, value, onchange) {
  const box = element('div', { className: 'segmented', role: 'group' });
  const press = (key) => {
    for (const b of box.children) b.setAttribute('aria-pressed', String(b.dataset.key === key));
  };
  for (const [key, text] of options) {
    const b = element('button', { type: 'button', onclick: () => { press(key); onchange(key); } }, text);
    b.dataset.key = key;
    box.append(b);
  }
  press(value);
  return { row: box, press };
}

export function section(title, ...rows) {
  return element('section', { className: 'panel-section' }, element('h3', {}, title), ...rows);
}

export function number(x) {
  if (typeof x !== 'number' || !Number.isFinite(x)) return String(x);
  if (x === 0 || Number.isInteger(x)) return String(x);
  return Math.abs(x) >= 999.5 ? x.toFixed(0) : String(+x.toPrecision(3));
}
