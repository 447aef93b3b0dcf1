// What the robot has not seen: shaded, darker where nothing is remembered either.
const outlines = D.scans.outline ? numbers(D.scans.outline) : null;
const MOST_REMEMBERED = 60; // scans that are laid over each other
const firstWith = []; // instant at which each scan came
if (scanOf) for (let k = count - 1; k >= 0; k--) if (scanOf[k] >= 0) firstWith[scanOf[k]] = k;
let holes = [];

function hole(which) { // where a scan's beams have passed, as a path of the map
  if (!holes[which]) {
    const k = 3 * firstWith[which], size = D.scans.corners, points = [];
    const c = Math.cos(pose[k + 2]), s = Math.sin(pose[k + 2]), unit = D.scans.outline.step;
    for (let j = 0; j < size; j++) {
      const x = outlines[2 * (which * size + j)] * unit;
      const y = outlines[2 * (which * size + j) + 1] * unit;
      points.push([pose[k] + c * x - s * y, pose[k + 1] + s * x + c * y]);
    }
    holes[which] = 'M' + lineOf(points) + 'Z';
  }
  return holes[which];
}

function buildSight(x, y, width, height) {
  holes = [];
  if (!outlines) return;
  for (const name of ['remembered', 'inSight']) {
    const area = { x, y, width, height };
    const mask = draw(M.unseen, 'mask', { id: name, maskUnits: 'userSpaceOnUse', ...area });
    draw(mask, 'rect', { fill: '#fff', ...area });
    M[name] = draw(mask, 'path', { fill: '#000' });
    draw(M.unseen, 'rect', { class: 'shade', mask: 'url(#' + name + ')', ...area });
  }
}

function drawSight(index) {
  if (!outlines) return;
  const newest = scanOf[index];
  M.inSight.setAttribute('d', newest < 0 ? '' : hole(newest));
  let oldest = newest;
  while (oldest > 0 && time[firstWith[oldest - 1]] > time[index] - D.scans.memory) oldest--;
  const stride = Math.ceil((newest - oldest + 1) / MOST_REMEMBERED) || 1;
  let passed = newest < 0 ? '' : hole(newest);
  for (let k = oldest; k >= 0 && k < newest; k++) if (k % stride === 0) passed += hole(k);
  M.remembered.setAttribute('d', passed);
}
