// What was driven: packed numbers become typed arrays, once.
const D = JSON.parse(document.getElementById('drive').textContent);
const KINDS = { f4: Float32Array, i2: Int16Array, i4: Int32Array };

function numbers(part) {
  const text = atob(part.data), bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  return new KINDS[part.kind](bytes.buffer);
}

const time = numbers(D.time), count = time.length, pose = numbers(D.pose);
const margin = numbers(D.margin), pathOf = numbers(D.pathOf), gateOf = numbers(D.gateOf);
const circlesOf = numbers(D.circlesOf), reasonOf = numbers(D.reasonOf);
const stages = D.stages, planned = numbers(D.plan);
const first = time[0], last = time[count - 1];
const others = D.beside.map((o) => ({ ...o, time: numbers(o.time), pose: numbers(o.pose) }));
const LEVELS = { SOLVED: 0, FEASIBLE: 1, FALLBACK: 2, STOPPED: 3 };
const PROGRESS = {
  DRIVING: 'driving', HOLDING: 'holding its goal', UNREACHABLE: 'no path to its goal',
  WAITING: 'waiting',
};
for (const chart of D.series) {
  for (const name of Object.keys(chart.lines)) chart.lines[name] = numbers(chart.lines[name]);
}

function plan(index) { // places [x, y] of the plan's stages [m]
  const found = [];
  for (let j = 0; j < stages; j++) {
    const k = 2 * (index * stages + j);
    found.push([planned[k] * D.plan.step + D.plan.middle[0],
      planned[k + 1] * D.plan.step + D.plan.middle[1]]);
  }
  return found;
}

function unpacked(part) { // sets of rows, one after the other
  if (!part.ends) return () => [];
  const ends = numbers(part.ends), rows = numbers(part.rows), width = part.width;
  return (which) => {
    const found = [];
    if (which < 0) return found;
    for (let k = ends[which]; k < ends[which + 1]; k++) {
      found.push(rows.subarray(width * k, width * (k + 1)));
    }
    return found;
  };
}

const circleSet = unpacked(D.circles), scanSet = unpacked(D.scans);
const scanOf = D.scans.of ? numbers(D.scans.of) : null;
const circlesAt = (index) => circleSet(circlesOf[index]);
const scanAt = (index) => (scanOf ? scanSet(scanOf[index]) : []);

function at(t, instants = time) { // number of the newest instant at a time [s]
  let low = 0, high = instants.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (instants[middle] <= t + 1e-4) low = middle; else high = middle - 1;
  }
  return low;
}

function placeAt(t, drive = { time, pose }) { // pose between two instants
  const k = at(t, drive.time), n = Math.min(k + 1, drive.time.length - 1);
  const span = drive.time[n] - drive.time[k], share = span > 0 ? Math.min((t - drive.time[k]) / span, 1) : 0;
  const found = [];
  for (let j = 0; j < 3; j++) {
    found.push(drive.pose[3 * k + j] + Math.max(share, 0) * (drive.pose[3 * n + j] - drive.pose[3 * k + j]));
  }
  return found;
}

function fixed(value, digits) { return value.toFixed(digits).replace(/^-(0(\.0+)?)$/, '$1'); }

function told(value, unit) { // a number as people read it
  if (!Number.isFinite(value)) return '–';
  if (unit === 'ms') return fixed(value, value < 10 ? 2 : value < 100 ? 1 : 0) + ' ms';
  return fixed(value, unit === 'm' && Math.abs(value) >= 10 ? 1 : 2) + ' ' + unit;
}

const SVG = 'http://www.w3.org/2000/svg';
function draw(parent, name, attributes, text) { // an element of a picture
  const made = document.createElementNS(SVG, name);
  for (const key of Object.keys(attributes || {})) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  parent.appendChild(made);
  return made;
}
function make(parent, name, attributes, text) { // an element of the page
  const made = document.createElement(name);
  for (const key of Object.keys(attributes || {})) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  parent.appendChild(made);
  return made;
}
const byId = (name) => document.getElementById(name);

function ticks(low, high, most) { // round numbers between two
  const raw = (high - low) / Math.max(most, 1), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= raw * 0.999) || raw;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    found.push(Number((k * step).toPrecision(6)));
  }
  return found;
}
