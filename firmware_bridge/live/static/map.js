// The map: everything in metres, east to the right, north up.

const LEAST = 1e-6;

export class Drawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.grid = null;
    this.gridOf = null;
    this.view = null;
  }

  draw(state) {
    const { canvas, pen } = this;
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const style = getComputedStyle(document.documentElement);
    this.colour = (name) => style.getPropertyValue(`--${name}`).trim();
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    this.fit(state, width, height);
    this.lines();
    if (state.grid) this.cells(state.grid);
    for (const polygon of state.polygons || []) this.polygon(polygon, true);
    for (const wall of state.walls || []) this.polygon(wall, true);
    this.obstacles(state);
    this.goal(state.goal, state, "goal");
    this.goal(state.wish, state, "plan");
    this.polyline(state.path, "path", 2, [6, 5]);
    this.polyline(state.trail, "trail", 2);
    this.tube(state);
    this.polyline(state.plan, "plan", 3, [], 3);
    this.unseen(state);
    this.points(state.scan);
    this.robot(state);
  }

  fit(state, width, height) {
    const b = [...(state.bounds || [-2, -2, 2, 2])], r = state.radius || 0.2;
    if (state.pose) {  // a robot that has left its area is shown all the same
      const [x, y] = state.pose;
      b[0] = Math.min(b[0], x); b[1] = Math.min(b[1], y);
      b[2] = Math.max(b[2], x); b[3] = Math.max(b[3], y);
    }
    const room = 1.5 * r, edge = 8;
    const wide = b[2] - b[0] + 2 * room, high = b[3] - b[1] + 2 * room;
    this.scale = Math.max(LEAST, Math.min((width - 2 * edge) / wide, (height - 2 * edge) / high));
    this.x0 = width / 2 - this.scale * (b[0] + b[2]) / 2;
    this.y0 = height / 2 + this.scale * (b[1] + b[3]) / 2;
    this.area = state.bounds;
    this.size = [width, height];
  }

  place(event) {  // where on the map a finger is [m]
    const box = this.canvas.getBoundingClientRect();
    return [(event.clientX - box.left - this.x0) / this.scale, (this.y0 - event.clientY + box.top) / this.scale];
  }

  at(x, y) { return [this.x0 + this.scale * x, this.y0 - this.scale * y]; }

  lines() {
    const { pen } = this, [width, height] = this.size;
    const wanted = 60 / this.scale;
    const ten = 10 ** Math.floor(Math.log10(wanted));
    const step = [1, 2, 5, 10].map((k) => k * ten).find((s) => s >= wanted) || wanted;
    pen.strokeStyle = pen.fillStyle = this.colour("line");
    pen.lineWidth = 1;
    pen.beginPath();
    const left = Math.ceil((0 - this.x0) / this.scale / step);
    for (let k = left; this.x0 + k * step * this.scale < width; k++) {
      const x = this.x0 + k * step * this.scale;
      pen.moveTo(x, 0); pen.lineTo(x, height);
    }
    const low = Math.ceil((this.y0 - height) / this.scale / step);
    for (let k = low; this.y0 - k * step * this.scale > 0; k++) {
      const y = this.y0 - k * step * this.scale;
      pen.moveTo(0, y); pen.lineTo(width, y);
    }
    pen.stroke();
    pen.fillStyle = this.colour("soft");
    pen.font = "12px system-ui, sans-serif";
    pen.fillText(`${Number(step.toPrecision(2))} m`, 8, height - 8);
    if (this.area) {
      const [x1, y1] = this.at(this.area[0], this.area[3]);
      const [x2, y2] = this.at(this.area[2], this.area[1]);
      pen.strokeStyle = this.colour("soft");
      pen.strokeRect(x1, y1, x2 - x1, y2 - y1);
    }
  }

  cells(grid) {
    if (this.gridOf !== grid) {  // painted once
      this.gridOf = grid;
      this.grid = document.createElement("canvas");
      this.grid.width = grid.width;
      this.grid.height = grid.height;
      const pen = this.grid.getContext("2d");
      const image = pen.createImageData(grid.width, grid.height);
      const bytes = atob(grid.cells);
      for (let k = 0; k < bytes.length; k++) {
        const row = grid.height - 1 - Math.floor(k / grid.width), column = k % grid.width;
        const to = 4 * (row * grid.width + column), value = bytes.charCodeAt(k);
        image.data[to] = image.data[to + 1] = image.data[to + 2] = 120;
        image.data[to + 3] = value === 1 ? 255 : value === 2 ? 70 : 0;
      }
      pen.putImageData(image, 0, 0);
    }
    const { pen } = this, [x, y] = this.at(grid.x, grid.y);
    pen.save();
    pen.translate(x, y);
    pen.rotate(-(grid.theta || 0));
    pen.imageSmoothingEnabled = false;
    const size = grid.resolution * this.scale;
    pen.drawImage(this.grid, 0, -grid.height * size, grid.width * size, grid.height * size);
    pen.restore();
  }

  polygon(corners, filled) {
    const { pen } = this;
    pen.beginPath();
    for (let k = 0; k + 1 < corners.length; k += 2) pen.lineTo(...this.at(corners[k], corners[k + 1]));
    pen.closePath();
    pen.fillStyle = pen.strokeStyle = this.colour("circle");
    pen.lineWidth = 2;
    if (filled) pen.fill();
    pen.stroke();
  }

  obstacles(state) {
    const { pen } = this, rows = state.circles || [];
    for (let k = 0; k + 4 < rows.length; k += 5) {
      const [x, y] = this.at(rows[k], rows[k + 1]), r = rows[k + 2] * this.scale;
      pen.beginPath();
      pen.arc(x, y, r, 0, 2 * Math.PI);
      pen.fillStyle = this.colour("circle");
      pen.fill();
      const vx = rows[k + 3], vy = rows[k + 4];
      if (vx || vy) this.arrow(x, y, Math.atan2(-vy, vx), Math.hypot(vx, vy) * this.scale + r, "red");
    }
  }

  body([px, py, theta], { outline, radius }, margin = 0) {  // what a robot covers there, of an outline without the margin
    const { pen } = this, [x, y] = this.at(px, py), c = Math.cos(theta), s = Math.sin(theta);
    if (!outline) {
      const r = Math.max(5, ((radius || 0.15) + margin) * this.scale);
      pen.moveTo(x + r, y);
      pen.arc(x, y, r, 0, 2 * Math.PI);
      return;
    }
    for (let k = 0; k < outline.length; k += 2) {
      const ahead = outline[k], left = outline[k + 1];
      const corner = this.at(px + c * ahead - s * left, py + s * ahead + c * left);
      if (k) pen.lineTo(...corner); else pen.moveTo(...corner);
    }
    pen.closePath();
  }

  goal(pose, state, name) {
    if (!pose) return;
    const { pen } = this, [x, y] = this.at(pose[0], pose[1]);
    const r = Math.max(5, (state.radius || 0.15) * this.scale);
    pen.beginPath();
    this.body(pose, state);
    pen.strokeStyle = this.colour(name);
    pen.lineWidth = 2;
    pen.setLineDash([4, 4]);
    pen.stroke();
    pen.setLineDash([]);
    this.arrow(x, y, -pose[2], 1.5 * r, name);
  }

  arrow(x, y, angle, length, name) {
    const { pen } = this, head = 7;
    pen.save();
    pen.translate(x, y);
    pen.rotate(angle);
    pen.beginPath();
    pen.moveTo(0, 0); pen.lineTo(length, 0);
    pen.moveTo(length - head, -head / 2); pen.lineTo(length, 0); pen.lineTo(length - head, head / 2);
    pen.strokeStyle = this.colour(name);
    pen.lineWidth = 2;
    pen.stroke();
    pen.restore();
  }

  polyline(numbers, name, width, dash = [], stride = 2) {
    if (!numbers || numbers.length < 2 * stride) return;
    const { pen } = this;
    pen.beginPath();
    for (let k = 0; k + 1 < numbers.length; k += stride) pen.lineTo(...this.at(numbers[k], numbers[k + 1]));
    pen.strokeStyle = this.colour(name);
    pen.lineWidth = width;
    pen.lineJoin = "round";
    pen.setLineDash(dash);
    pen.stroke();
    pen.setLineDash([]);
  }

  tube(state) {
    const { plan, margins } = state;
    if (!plan || !margins) return;
    const { pen } = this;
    pen.fillStyle = this.colour("margin");
    pen.globalAlpha = 0.3;
    pen.beginPath();  // one shape of them all
    for (let k = 1; k <= margins.length && 3 * k + 2 < plan.length; k++) {
      this.body(plan.slice(3 * k, 3 * k + 3), state, margins[k - 1]);
    }
    pen.fill();
    pen.globalAlpha = 1;
  }

  unseen({ seen, views }) {  // out of sight now, and darker what was not seen lately either
    if (!seen) return;
    const { canvas, pen } = this;
    for (const outlines of [[seen], [...(views || []), seen]]) {
      const veil = this.veil || (this.veil = document.createElement("canvas")), cut = veil.getContext("2d");
      veil.width = canvas.width; veil.height = canvas.height;
      cut.setTransform(pen.getTransform());
      cut.globalAlpha = 0.2;
      cut.fillStyle = this.colour("soft");
      cut.fillRect(0, 0, ...this.size);
      cut.globalAlpha = 1;
      cut.globalCompositeOperation = "destination-out";
      for (const outline of outlines) {
        cut.beginPath();
        for (let k = 0; k + 1 < outline.length; k += 2) cut.lineTo(...this.at(outline[k], outline[k + 1]));
        cut.fill();
      }
      pen.drawImage(veil, 0, 0, ...this.size);
    }
  }

  points(numbers) {
    if (!numbers) return;
    const { pen } = this;
    pen.fillStyle = this.colour("scan");
    for (let k = 0; k + 1 < numbers.length; k += 2) {
      const [x, y] = this.at(numbers[k], numbers[k + 1]);
      pen.fillRect(x - 1.5, y - 1.5, 3, 3);
    }
  }

  robot(state) {
    if (!state.pose) return;
    const { pen } = this, [px, py, theta] = state.pose, [x, y] = this.at(px, py);
    const r = Math.max(5, (state.radius || 0.15) * this.scale);
    pen.beginPath();
    this.body(state.pose, state);
    pen.fillStyle = this.colour(state.latched ? "red" : "plan");
    pen.globalAlpha = 0.85;
    pen.fill();
    pen.globalAlpha = 1;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + r * Math.cos(theta), y - r * Math.sin(theta));
    pen.strokeStyle = this.colour("card");
    pen.lineWidth = 3;
    pen.stroke();
  }
}
