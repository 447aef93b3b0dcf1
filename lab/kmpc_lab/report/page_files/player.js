// Playback: one time, shown by map, numbers and charts alike.
const slider = byId('time'), play = byId('play'), said = byId('said');
let now = Math.max(first, Math.min(0, last)), playing = false, before = 0, waiting = 0;
const rows = {};

function show(t) {
  now = Math.min(Math.max(t, first), last);
  const index = at(now), place = placeAt(now);
  drawMoment(index, place);
  drawOthers(now);
  moveCharts(index, now);
  readOut(index);
  slider.value = now;
  slider.setAttribute('aria-valuetext', fixed(now, 1) + ' s: ' + statusOf(index));
  byId('clock').textContent = fixed(now, 2) + ' s of ' + fixed(last, 1) + ' s';
}

function statusOf(index) {
  return D.statusWords[D.status[index]] || D.status[index];
}

function readOut(index) {
  const status = byId('now'), level = LEVELS[D.status[index]] || 0;
  status.textContent = 'At ' + fixed(time[index], 2) + ' s: ' + statusOf(index);
  status.className = level > 1 ? 'now wrong' : 'now';
  byId('why').textContent = reasonsOf(index).join('. ');
  for (const chart of D.series) {
    for (const name of Object.keys(chart.lines)) {
      const lone = Object.keys(chart.lines).length === 1;
      set(lone ? chart.title : chart.title + ', ' + name, told(chart.lines[name][index], chart.unit));
    }
  }
  if (keepsMargins) set('Margin kept, next step', told(margin[index * stages + 1], 'm'));
  set('Position', fixed(pose[3 * index], 2) + ', ' + fixed(pose[3 * index + 1], 2) + ' m');
  for (const other of others) {
    const place = placeAt(now, other);
    const apart = Math.hypot(place[0] - pose[3 * index], place[1] - pose[3 * index + 1]);
    set(other.name, fixed(apart, 2) + ' m away');
  }
  set('Heading', told((pose[3 * index + 2] * 180) / Math.PI, '°').replace(/\.\d+ /, ''));
}

function reasonsOf(index) { // why the robot does what it does, in words
  const found = [], reason = D.reason[reasonOf[index]], gate = D.gates[gateOf[index]];
  if (reason) found.push(reason[0].toUpperCase() + reason.slice(1));
  if (D.progress[index]) found.push('The robot is ' + (PROGRESS[D.progress[index]] || D.progress[index]));
  if (pathOf[index] >= 0) {
    let k = index;
    while (k > 0 && pathOf[k - 1] === pathOf[index]) k--;
    found.push('It follows path ' + (pathOf[index] + 1) + ' of ' + D.paths.length + ', found at ' +
      fixed(time[k], 2) + ' s');
  }
  const nearest = nearestOf(index);
  if (nearest) found.push(nearest);
  if (gate) found.push('Safety gate ' + gate);
  return found;
}

function nearestOf(index) {
  const points = plan(index);
  let best = Infinity, words = '';
  if (D.map.outline) return words; // how it turns on its way is not told here
  for (const circle of circlesAt(index)) {
    const [kept, away] = marginTo(circle, index, points);
    if (away < best) {
      best = away;
      words = 'The plan passes the circle at ' + fixed(circle[0], 2) + ', ' + fixed(circle[1], 2) +
        ' m at ' + fixed(Math.max(away, 0), 2) + ' m' + (kept ? ', ' + fixed(kept, 2) + ' m are kept' : '');
    }
  }
  return best < 10 * D.map.radius ? words : '';
}

function set(name, value) {
  if (!rows[name]) {
    make(byId('numbers'), 'dt', {}, name);
    rows[name] = make(byId('numbers'), 'dd');
  }
  rows[name].textContent = value;
}

function seek(t) { // by hand: it stops, says where it is, and the link leads there
  pause();
  show(t);
  clearTimeout(waiting);
  waiting = setTimeout(() => {
    said.textContent = byId('now').textContent + '. ' + byId('why').textContent;
    try { history.replaceState(null, '', '#t=' + fixed(now, 2)); } catch (error) { /* a copy */ }
  }, 300);
}

function step(by) {
  const index = at(now), off = now - time[index] > 1e-3 && by < 0;
  seek(time[Math.min(Math.max(index + by + (off ? 1 : 0), 0), count - 1)]);
}

function pause() {
  playing = false;
  play.textContent = 'Play';
}

function toggle() {
  if (playing) { seek(now); return; }
  if (now >= last - 1e-6) show(Math.max(first, Math.min(0, last)));
  playing = true;
  play.textContent = 'Pause';
  said.textContent = 'Playing';
  before = performance.now();
  requestAnimationFrame(frame);
}

function frame(stamp) {
  if (!playing) return;
  const speed = Number(byId('speed').value);
  const passed = Math.max(stamp - before, 0) / 1000;
  before = stamp;
  show(now + speed * passed);
  if (now >= last - 1e-6) seek(last); else requestAnimationFrame(frame);
}

function onKey(event) {
  const target = event.target, tag = target.tagName;
  if (event.ctrlKey || event.altKey || event.metaKey || tag === 'SELECT') return;
  if (tag === 'SUMMARY' || (event.key === ' ' && (tag === 'BUTTON' || target.type === 'checkbox'))) {
    return;
  }
  const moves = {
    ' ': toggle,
    ArrowLeft: () => (event.shiftKey ? seek(now - 1) : step(-1)),
    ArrowRight: () => (event.shiftKey ? seek(now + 1) : step(1)),
    Home: () => seek(first),
    End: () => seek(last),
    '+': () => zoom(1.6),
    '-': () => zoom(1 / 1.6),
    0: () => zoom(0),
  };
  if (!moves[event.key]) return;
  event.preventDefault();
  moves[event.key]();
}

function makeLayers() {
  for (const [name, words, paint] of LAYERS) {
    if ((name === 'scan' || name === 'unseen') && !scanOf) continue;
    if (name === 'path' && !D.paths.length) continue;
    if (name === 'room' && !keepsMargins) continue;
    if (name === 'others' && !others.length) continue;
    const label = make(document.querySelector('.layers'), 'label');
    const box = make(label, 'input', { type: 'checkbox' });
    box.checked = true;
    make(label, 'i').style.borderColor = 'var(' + paint + ')';
    label.append(words);
    box.addEventListener('change', () => {
      hidden[name] = !box.checked;
      M[name].style.display = hidden[name] ? 'none' : '';
    });
  }
}

function linkEvents() {
  for (const place of document.querySelectorAll('span.when')) {
    const button = document.createElement('button');
    button.type = 'button';
    button.className = 'when';
    button.textContent = place.textContent;
    button.addEventListener('click', () => {
      seek(Number(place.dataset.time));
      document.querySelector('.player').scrollIntoView({ block: 'start' });
    });
    place.replaceWith(button);
  }
}

function fromLink() {
  const found = /^#t=(-?\d+(\.\d+)?)$/.exec(location.hash);
  if (found) show(Number(found[1]));
}

function build() {
  buildMap();
  buildCharts();
  show(now);
}

document.documentElement.classList.add('scripted');
document.querySelector('.player').hidden = false;
slider.min = first;
slider.max = last;
slider.step = 'any';
slider.addEventListener('input', () => seek(Number(slider.value)));
play.addEventListener('click', toggle);
byId('back').addEventListener('click', () => step(-1));
byId('ahead').addEventListener('click', () => step(1));
document.addEventListener('keydown', onKey);
map.addEventListener('pointermove', (event) => {
  const k = nearestOnTrace(event);
  if (k < 0) { tip.hidden = true; return; }
  tell(tip, event, fixed(time[k], 2) + ' s: ' + statusOf(k) + ', ' +
    told(D.series[0].lines.planned[k], 'm/s'));
});
let grip = null, moved = false;
map.addEventListener('pointerdown', (event) => { grip = [event.clientX, event.clientY]; moved = false; });
addEventListener('pointerup', () => { grip = null; });
map.addEventListener('pointermove', (event) => {
  if (!grip || view === D.map.view) return;
  const by = [event.clientX - grip[0], event.clientY - grip[1]];
  if (!moved && Math.hypot(...by) < 6) return;
  moved = true;
  grip = [event.clientX, event.clientY];
  pan(...by);
});
map.addEventListener('wheel', (event) => {
  if (!event.ctrlKey && view === D.map.view && event.deltaY > 0) return; // the page scrolls on
  event.preventDefault();
  const box = map.getBoundingClientRect();
  zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
}, { passive: false });
for (const [name, factor] of [['closer', 1.6], ['wider', 1 / 1.6], ['whole', 0]]) {
  byId(name).addEventListener('click', () => zoom(factor));
}
map.addEventListener('pointerleave', () => { tip.hidden = true; });
map.addEventListener('click', (event) => {
  if (moved) return;
  const k = nearestOnTrace(event);
  if (k >= 0) seek(time[k]);
});
makeLayers();
makeCharts(seek);
linkEvents();
build();
fromLink();
addEventListener('hashchange', fromLink);
let built = innerWidth;
addEventListener('resize', () => { if (innerWidth !== built) { built = innerWidth; build(); } });
