// Charts over time: lines, limits, how plans came about, and a cursor at the instant that is shown.
const HEIGHT = 132, LEFT = 44, BOTTOM = 22, TOP = 8;
const charts = [];

function makeCharts(seek) {
  for (const series of D.series) {
    const box = make(byId('charts'), 'div', { class: 'chart' });
    const head = make(box, 'h3', {}, series.title);
    const unit = make(head, 'span', {}, '[' + series.unit + ']');
    const names = Object.keys(series.lines);
    const values = names.map((name, k) => make(head, 'b', { class: 'l' + k }));
    const picture = draw(box, 'svg', { role: 'img', 'aria-label': series.title + ' over time, ' +
      range(series) });
    const chart = { series, names, values, picture, unit, tip: make(box, 'div', { class: 'tip' }) };
    chart.tip.hidden = true;
    listen(chart, seek);
    charts.push(chart);
  }
}

function range(series) { // least and largest value, for those who do not see the lines
  return Object.keys(series.lines).map((name) => {
    const good = series.lines[name].filter(Number.isFinite);
    const low = good.reduce((a, b) => Math.min(a, b), Infinity);
    const high = good.reduce((a, b) => Math.max(a, b), -Infinity);
    return name + ' from ' + told(low, series.unit) + ' to ' + told(high, series.unit);
  }).join('; ');
}

function listen(chart, seek) {
  const timeOf = (event) => {
    const box = chart.picture.getBoundingClientRect();
    const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - 6);
    return first + Math.min(Math.max(share, 0), 1) * (last - first);
  };
  let down = false;
  chart.picture.addEventListener('pointerdown', (event) => {
    down = true;
    chart.picture.setPointerCapture(event.pointerId);
    seek(timeOf(event));
  });
  chart.picture.addEventListener('pointermove', (event) => {
    const t = timeOf(event), index = at(t);
    if (down) seek(t);
    const words = chart.names.map((name) => (chart.names.length > 1 ? name + ' ' : '') +
      told(chart.series.lines[name][index], chart.series.unit));
    tell(chart.tip, event, fixed(time[index], 2) + ' s: ' + words.join(', '));
  });
  for (const name of ['pointerup', 'pointercancel']) {
    chart.picture.addEventListener(name, () => { down = false; });
  }
  chart.picture.addEventListener('pointerleave', () => { chart.tip.hidden = true; });
}

function buildCharts() {
  for (const chart of charts) buildChart(chart);
}

function buildChart(chart) {
  const { series, picture } = chart, width = Math.max(picture.parentNode.clientWidth, 160);
  picture.setAttribute('viewBox', '0 0 ' + width + ' ' + HEIGHT);
  picture.style.height = HEIGHT + 'px';
  picture.replaceChildren();
  const [low, high] = span(series), end = HEIGHT - BOTTOM;
  const x = (t) => LEFT + ((width - LEFT - 6) * (t - first)) / Math.max(last - first, 1e-9);
  const y = (value) => end - ((end - TOP) * (value - low)) / (high - low);
  drawBands(picture, x, end);
  for (const tick of ticks(low, high, 4)) {
    draw(picture, 'line', { class: 'grid', x1: LEFT, x2: width, y1: y(tick), y2: y(tick) });
    draw(picture, 'text', { x: LEFT - 6, y: y(tick) + 4, 'text-anchor': 'end' }, String(tick));
  }
  for (const tick of ticks(first, last, width / 80)) {
    draw(picture, 'text', { x: x(tick), y: HEIGHT - 5, 'text-anchor': 'middle' }, tick + ' s');
  }
  for (const limit of series.limits) {
    if (limit >= low && limit <= high) {
      draw(picture, 'line', { class: 'limit', x1: LEFT, x2: width, y1: y(limit), y2: y(limit) });
    }
  }
  chart.names.forEach((name, k) => {
    draw(picture, 'path', { class: 'l' + k, d: curve(series.lines[name], x, y) });
  });
  chart.x = x;
  chart.cursor = draw(picture, 'line', { class: 'cursor', y1: 0, y2: end });
}

function span(series) { // what a chart shows, with some room
  let low = Infinity, high = -Infinity;
  const take = (value) => {
    if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
  };
  for (const name of Object.keys(series.lines)) series.lines[name].forEach(take);
  const room = (high - low) * 0.6 + 1e-9; // limits that are far away are left out
  for (const limit of series.limits) {
    if (limit > low - room && limit < high + room) take(limit);
  }
  if (series.unit === 'ms' || low > 0) low = Math.min(low, 0);
  const pad = 0.06 * (high - low) || 0.1;
  return [low - (low < 0 ? pad : 0), high + pad];
}

function curve(values, x, y) { // a line that breaks where nothing is known
  let d = '', pen = 'M';
  for (let k = 0; k < count; k++) {
    if (!Number.isFinite(values[k])) { pen = 'M'; continue; }
    d += pen + x(time[k]).toFixed(1) + ' ' + y(values[k]).toFixed(1);
    pen = 'L';
  }
  return d;
}

function drawBands(picture, x, end) {
  for (let k = 0; k < count;) {
    let n = k;
    while (n < count && D.status[n] === D.status[k]) n++;
    const level = LEVELS[D.status[k]];
    if (level) {
      const until = n < count ? time[n] : last + D.dt;
      draw(picture, 'rect', { class: 'band b' + level, x: x(time[k]), y: TOP,
        width: Math.max(x(until) - x(time[k]), 0.5), height: end - TOP });
    }
    k = n;
  }
}

function moveCharts(index, t) {
  for (const chart of charts) {
    const x = chart.x(t);
    chart.cursor.setAttribute('x1', x);
    chart.cursor.setAttribute('x2', x);
    chart.names.forEach((name, k) => {
      const value = told(chart.series.lines[name][index], chart.series.unit);
      chart.values[k].textContent = (chart.names.length > 1 ? name + ' ' : '') + value;
    });
  }
}
