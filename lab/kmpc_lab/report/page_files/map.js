// The map: what stays is drawn once for a width, what changes at every instant.
const LAYERS = [
  ['unseen', 'out of sight, dark: unknown', '--soft'],
  ['plan', 'plan', '--plan'], ['room', 'margins', '--plan'], ['path', 'path', '--good'],
  ['scan', 'scan', '--scan'], ['trace', 'whole drive', '--robot'], ['others', others.map((o) => o.name + ': ' + o.ended).join('; '), '--other'],
];
const map = byId('map'), tip = byId('tip'), hidden = {};
const keepsMargins = margin.some((value) => value > 0);
let M = null, view = D.map.view;

function lineOf(points) {
  return points.map((p) => M.x(p[0]).toFixed(1) + ',' + M.y(p[1]).toFixed(1)).join(' ');
}

function buildMap() {
  const width = Math.max(map.parentNode.clientWidth, 200), v = view;
  const wide = v[2] - v[0], tall = v[3] - v[1];
  const scale = Math.min((width - 34) / wide, Math.max(0.52 * innerHeight, 280) / tall);
  const height = scale * tall + 24, left = 34 + (width - 34 - scale * wide) / 2;
  M = { scale, width, height, x: (x) => left + scale * (x - v[0]), y: (y) => scale * (v[3] - y),
    place: (x, y) => [v[0] + (x - left) / scale, v[3] - y / scale] };
  map.setAttribute('viewBox', '0 0 ' + width + ' ' + height);
  map.style.height = height + 'px';
  map.replaceChildren();
  const b = D.map.bounds, still = draw(map, 'g');
  draw(still, 'rect', { class: 'area', x: M.x(b[0]), y: M.y(b[3]), width: scale * (b[2] - b[0]),
    height: scale * (b[3] - b[1]) });
  drawGrid(still, v);
  drawSolids(still);
  drawGoal(still);
  for (const [name] of LAYERS) M[name] = draw(map, 'g');
  M.circles = draw(map, 'g');
  map.insertBefore(M.circles, M.plan);
  buildSight(left, 0, scale * wide, scale * tall);
  const whole = [];
  for (let k = 0; k < count; k++) whole.push([pose[3 * k], pose[3 * k + 1]]);
  draw(M.trace, 'polyline', { class: 'trace', points: lineOf(whole) });
  M.driven = draw(map, 'polyline', { class: 'driven' });
  M.points = lineOf(whole).split(' ');
  M.robot = draw(map, 'g');
  if (D.map.outline) { // its own frame: the page's y points down
    const points = D.map.outline.map(([x, y]) => scale * x + ',' + -scale * y).join(' ');
    draw(M.robot, 'polygon', { class: 'robot', points });
  } else draw(M.robot, 'circle', { class: 'robot', r: scale * D.map.radius });
  draw(M.robot, 'line', { class: 'nose', x1: 0, y1: 0, x2: scale * D.map.front, y2: 0 });
  for (const other of others) {
    const places = [];
    for (let k = 0; k < other.time.length; k++) places.push([other.pose[3 * k], other.pose[3 * k + 1]]);
    draw(M.others, 'polyline', { class: 'other', points: lineOf(places) });
    other.robot = draw(M.others, 'circle', { class: 'other', r: scale * D.map.radius });
    other.nose = draw(M.others, 'line', { class: 'other' });
  }
  drawNumbers(draw(map, 'g'), v);
  for (const [name] of LAYERS) M[name].style.display = hidden[name] ? 'none' : '';
}

function drawGrid(parent, v) {
  for (const x of ticks(v[0], v[2], M.width / 70)) {
    draw(parent, 'line', { class: 'grid', x1: M.x(x), x2: M.x(x), y1: 0, y2: M.height - 24 });
  }
  for (const y of ticks(v[1], v[3], M.height / 60)) {
    draw(parent, 'line', { class: 'grid', x1: 34, x2: M.width, y1: M.y(y), y2: M.y(y) });
  }
}

function drawNumbers(parent, v) { // at the edges, over whatever a zoomed map has there
  draw(parent, 'rect', { class: 'rim', x: 0, y: 0, width: 34, height: M.height });
  draw(parent, 'rect', { class: 'rim', x: 0, y: M.height - 24, width: M.width, height: 24 });
  for (const x of ticks(v[0], v[2], M.width / 70)) {
    draw(parent, 'text', { x: M.x(x), y: M.height - 8, 'text-anchor': 'middle' }, x + ' m');
  }
  for (const y of ticks(v[1], v[3], M.height / 60)) {
    draw(parent, 'text', { x: 30, y: M.y(y) + 4, 'text-anchor': 'end' }, String(y));
  }
}

function zoom(factor, x = M.width / 2, y = M.height / 2) { // about a point of the picture; 0: all
  const whole = D.map.view, [px, py] = M.place(x, y);
  const wide = Math.min((view[2] - view[0]) / factor, whole[2] - whole[0]);
  const share = wide / (view[2] - view[0]);
  if (!factor || share > 1 - 1e-9 && factor < 1) view = whole;
  else if (wide > 0.02 * (whole[2] - whole[0])) {
    view = [px + share * (view[0] - px), py + share * (view[1] - py),
      px + share * (view[2] - px), py + share * (view[3] - py)];
  }
  map.style.touchAction = view === whole ? '' : 'none';
  redraw();
}

function pan(dx, dy) { // by so much of the picture
  view = [view[0] - dx / M.scale, view[1] + dy / M.scale, view[2] - dx / M.scale, view[3] + dy / M.scale];
  redraw();
}

function redraw() {
  buildMap();
  show(now);
}

function drawOthers(t) {
  for (const other of others) {
    const [x, y, theta] = placeAt(t, other), far = M.scale * D.map.front;
    other.robot.setAttribute('cx', M.x(x));
    other.robot.setAttribute('cy', M.y(y));
    other.nose.setAttribute('x1', M.x(x));
    other.nose.setAttribute('y1', M.y(y));
    other.nose.setAttribute('x2', M.x(x) + far * Math.cos(theta));
    other.nose.setAttribute('y2', M.y(y) - far * Math.sin(theta));
  }
}

function drawSolids(parent) {
  for (const [x, y, r] of D.map.known) { // on the map, whether the robot was told or not
    draw(parent, 'circle', { class: 'known', cx: M.x(x), cy: M.y(y), r: M.scale * r });
  }
  for (const outline of D.map.outlines) {
    draw(parent, 'polygon', { class: 'solid', points: lineOf(outline) });
  }
  for (const [x1, y1, x2, y2, thick] of D.map.walls) {
    draw(parent, 'line', { class: 'edge', x1: M.x(x1), y1: M.y(y1), x2: M.x(x2), y2: M.y(y2),
      'stroke-width': Math.max(M.scale * thick, 2) });
  }
  let boxes = '';
  for (const c of D.map.boxes) {
    boxes += 'M' + lineOf([[c[0], c[1]], [c[2], c[3]], [c[4], c[5]], [c[6], c[7]]]) + 'Z';
  }
  if (boxes) draw(parent, 'path', { class: 'solid', d: boxes });
}

function drawGoal(parent) {
  const [x, y, heading] = D.map.goal, r = D.map.radius, far = 1.6 * r;
  const tipX = M.x(x + far * Math.cos(heading)), tipY = M.y(y + far * Math.sin(heading));
  const place = { cx: M.x(x), cy: M.y(y) };
  draw(parent, 'circle', { ...place, class: 'goal there', r: M.scale * D.map.tolerance });
  if (D.map.outline) {
    const c = Math.cos(heading), s = Math.sin(heading);
    const corners = D.map.outline.map(([a, b]) => [x + c * a - s * b, y + s * a + c * b]);
    draw(parent, 'polygon', { class: 'goal', points: lineOf(corners) });
  } else draw(parent, 'circle', { ...place, class: 'goal', r: M.scale * r });
  draw(parent, 'line', { class: 'goal', x1: M.x(x), y1: M.y(y), x2: tipX, y2: tipY });
  for (const [words, at] of [['goal', D.map.goal], ['start', D.map.start]]) {
    draw(parent, 'text', { class: 'name', x: M.x(at[0]), 'text-anchor': 'middle',
      y: M.y(at[1]) + M.scale * r + 15 }, words);
  }
}

function drawMoment(index, place) {
  const points = plan(index), circles = circlesAt(index);
  drawSight(index);
  M.circles.replaceChildren();
  for (const [x, y, r] of circles) {
    draw(M.circles, 'circle', { class: 'solid', cx: M.x(x), cy: M.y(y), r: M.scale * r });
  }
  M.plan.replaceChildren();
  draw(M.plan, 'polyline', { class: 'plan', points: lineOf(points) });
  const end = points[points.length - 1];
  draw(M.plan, 'circle', { class: 'stop', cx: M.x(end[0]), cy: M.y(end[1]), r: 3.5 });
  drawMargins(index, points, circles);
  M.path.replaceChildren();
  const path = D.paths[pathOf[index]];
  if (path) draw(M.path, 'polyline', { class: 'path', points: lineOf(path) });
  M.scan.replaceChildren();
  const hits = scanAt(index), k = hits.length ? 3 * firstWith[scanOf[index]] : 0;
  const c = Math.cos(pose[k + 2]), s = Math.sin(pose[k + 2]); // where it was seen from
  for (const [x, y] of hits) {
    draw(M.scan, 'circle', { class: 'scan', r: 2, cx: M.x(pose[k] + c * x - s * y),
      cy: M.y(pose[k + 1] + s * x + c * y) });
  }
  M.driven.setAttribute('points', M.points.slice(0, index + 1).join(' ') + ' ' + lineOf([place]));
  M.robot.setAttribute('transform', 'translate(' + M.x(place[0]) + ' ' + M.y(place[1]) +
    ') rotate(' + (-place[2] * 180) / Math.PI + ')');
}

function marginTo(circle, index, points) { // [margin, clearance] of the stage nearest to a circle
  let nearest = Infinity, kept = 0;
  for (let j = 1; j < stages; j++) {
    const away = Math.hypot(points[j][0] - circle[0], points[j][1] - circle[1]);
    if (away < nearest) { nearest = away; kept = margin[index * stages + j]; }
  }
  return [kept, nearest - circle[2] - D.map.radius];
}

function drawMargins(index, points, circles) {
  M.room.replaceChildren();
  const room = draw(M.room, 'g', { class: 'rooms' }); // one shade, however many lie on each other
  for (let j = 1; j < stages && keepsMargins; j++) {
    const r = M.scale * (D.map.aside + margin[index * stages + j]);
    draw(room, 'circle', { class: 'room', cx: M.x(points[j][0]), cy: M.y(points[j][1]), r });
  }
  for (const circle of circles) {
    const [kept, away] = marginTo(circle, index, points);
    if (kept > 0 && away < 10 * D.map.radius) {
      draw(M.room, 'circle', { class: 'ring', cx: M.x(circle[0]), cy: M.y(circle[1]),
        r: M.scale * (circle[2] + kept) });
    }
  }
}

function nearestOnTrace(event) { // instant of the driven path under the pointer, or -1
  const box = map.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
  let best = 18, found = -1;
  for (let k = 0; k < count; k++) {
    const away = Math.hypot(M.x(pose[3 * k]) - x, M.y(pose[3 * k + 1]) - y);
    if (away < best) { best = away; found = k; }
  }
  return found;
}

function tell(box, event, words) { // a small box beside the pointer, inside its parent
  const around = box.parentNode.getBoundingClientRect(), x = event.clientX - around.left;
  box.textContent = words;
  box.hidden = false;
  box.style.left = Math.min(x + 14, Math.max(around.width - box.offsetWidth - 4, 0)) + 'px';
  box.style.top = Math.max(event.clientY - around.top - 36, 0) + 'px';
}
