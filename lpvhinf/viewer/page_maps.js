// Maps of the plane: the position within P with a certificate's cells, and the mover over its coils.

const PAD = 26;

// From metres to pixels of the position map, and back.
function mapScale(width, height) {
  const [x0, x1] = box[0], [y0, y1] = planar ? box[1] : [-1, 1];
  const w = width - 2 * PAD, h = height - 2 * PAD;
  return {
    X: (x) => PAD + ((x - x0) / (x1 - x0)) * w,
    Y: (y) => PAD + ((y1 - y) / (y1 - y0)) * h,
    back: (px, py) => [
      x0 + (Math.min(Math.max(px - PAD, 0), w) / w) * (x1 - x0),
      y1 - (Math.min(Math.max(py - PAD, 0), h) / h) * (y1 - y0),
    ],
  };
}

// From a light to a strong tint with the margin, by rank between the smallest and the largest.
function tint(share) {
  return isDark() ? `hsl(165 45% ${18 + 30 * share}%)` : `hsl(165 45% ${88 - 40 * share}%)`;
}

function drawMap(canvas) {
  const { ctx, width, height } = context(canvas), { X, Y } = mapScale(width, height);
  const [x0, x1] = box[0], [y0, y1] = planar ? box[1] : [-1, 1];
  ctx.fillStyle = ink("--grid");
  ctx.fillRect(X(x0), Y(y1), X(x1) - X(x0), Y(y0) - Y(y1));
  const claim = certificates[state.claim];
  if (claim) drawCells(ctx, claim, X, Y);
  ctx.fillStyle = ink("--soft");
  ctx.globalAlpha = 0.55;
  for (const x of axes[0]) for (const y of planar ? axes[1] : [0]) ctx.fillRect(X(x) - 0.75, Y(y) - 0.75, 1.5, 1.5);
  ctx.globalAlpha = 1;
  ctx.strokeStyle = ink("--line");
  ctx.lineWidth = 1;
  ctx.strokeRect(X(x0), Y(y1), X(x1) - X(x0), Y(y0) - Y(y1));
  for (const [value] of ticks([MM * x0, MM * x1], false, 3)) text(ctx, plain(value), X(value / MM), height - PAD + 14, "center");
  if (planar) for (const [value] of ticks([MM * y0, MM * y1], false, 3)) text(ctx, plain(value), PAD - 4, Y(value / MM) + 4, "right");
  text(ctx, "mm", width - 14, height - PAD + 14, "center");
  const x = X(state.p[0]), y = Y(planar ? state.p[1] : 0);
  ctx.strokeStyle = ink("--ink");
  ctx.globalAlpha = 0.35;
  line(ctx, x, Y(y1), x, Y(y0));
  if (planar) line(ctx, X(x0), y, X(x1), y);
  ctx.globalAlpha = 1;
  ctx.beginPath();
  ctx.arc(x, y, 8, 0, 2 * Math.PI);
  ctx.fillStyle = ink("--accent");
  ctx.fill();
  ctx.lineWidth = 2.5;
  ctx.strokeStyle = ink("--card");
  ctx.stroke();
}

function drawCells(ctx, claim, X, Y) {
  let low = Infinity, high = -Infinity;
  for (const margin of claim.margins) if (margin === margin) [low, high] = [Math.min(low, margin), Math.max(high, margin)];
  for (let i = 0; i < claim.proved.length; i++) {
    const [a, b, c, d] = claim.cells.subarray(4 * i, 4 * i + 4);
    const share = high > low ? (claim.margins[i] - low) / (high - low) : 0.5;
    ctx.fillStyle = !claim.proved[i] ? ink("--bad") : tint(share === share ? share : 0.5);
    ctx.globalAlpha = claim.proved[i] ? 1 : 0.45;
    ctx.fillRect(X(a), Y(d), X(b) - X(a), Y(c) - Y(d));
    ctx.globalAlpha = 1;
    ctx.strokeStyle = ink("--card");
    ctx.lineWidth = 0.5;
    ctx.strokeRect(X(a), Y(d), X(b) - X(a), Y(c) - Y(d));
  }
  if (claim.outcome === "proved" && !claim.proved.length) return;
}

// Value of the chosen mode shape, -1 to 1, at a point of the mover [m]; NaN off it.
function deflection(x, y) {
  const n = machine.n_shape, half = machine.side / 2;
  if (Math.abs(x) > half * 1.0001 || Math.abs(y) > half * 1.0001) return NaN;
  const u = ((x + half) / machine.side) * (n - 1), v = ((y + half) / machine.side) * (n - 1);
  const i = Math.min(Math.max(Math.floor(u), 0), n - 2), j = Math.min(Math.max(Math.floor(v), 0), n - 2);
  const a = u - i, b = v - j, at = (k, l) => machine.shapes[state.mode * n * n + k * n + l] / 127;
  return (1 - a) * ((1 - b) * at(i, j) + b * at(i, j + 1)) + a * ((1 - b) * at(i + 1, j) + b * at(i + 1, j + 1));
}

// Blue below, orange above, nothing at a node.
function diverging(value) {
  const dark = isDark(), base = dark ? [34, 38, 44] : [250, 250, 249];
  const end = value < 0 ? (dark ? [86, 180, 233] : [0, 114, 178]) : dark ? [240, 140, 74] : [213, 94, 0];
  const s = Math.min(1, Math.abs(value));
  return base.map((b, k) => Math.round(b + s * (end[k] - b)));
}

const picture = document.createElement("canvas");

function shapePicture() {
  const n = machine.n_shape, key = `${state.mode} ${isDark()}`;
  if (picture.dataset.key === key) return picture;
  picture.width = picture.height = n;
  const ctx = picture.getContext("2d"), image = ctx.createImageData(n, n);
  for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) {
    const colour = diverging(machine.shapes[state.mode * n * n + i * n + j] / 127);
    image.data.set([...colour, 255], 4 * ((n - 1 - j) * n + i));
  }
  ctx.putImageData(image, 0, 0);
  picture.dataset.key = key;
  return picture;
}

function drawMover(canvas) {
  const { ctx, width, height } = context(canvas), half = machine.side / 2;
  let reach = half + 0.06;
  for (const [x, y, w, h] of machine.coils) reach = Math.max(reach, Math.abs(x) + w / 2, Math.abs(y) + h / 2);
  const scale = Math.min(width, height) / (2 * reach * 1.03);
  const X = (x) => width / 2 + scale * x, Y = (y) => height / 2 - scale * y;
  ctx.lineWidth = 0.7;
  for (const [x, y, w, h, layer] of machine.coils) {
    ctx.strokeStyle = ink(layer ? "--grid" : "--line");
    ctx.strokeRect(X(x - w / 2), Y(y + h / 2), scale * w, scale * h);
  }
  const [px, py] = state.p;
  ctx.imageSmoothingEnabled = true;
  ctx.drawImage(shapePicture(), X(px - half), Y(py + half), 2 * half * scale, 2 * half * scale);
  ctx.strokeStyle = ink("--ink");
  ctx.lineWidth = 1.2;
  ctx.strokeRect(X(px - half), Y(py + half), 2 * half * scale, 2 * half * scale);
  nodeLines(ctx, (x) => X(px + x), (y) => Y(py + y));
  ctx.setLineDash([4, 3]);
  ctx.strokeStyle = ink("--soft");
  ctx.strokeRect(X(box[0][0]), Y(box[1][1]), scale * (box[0][1] - box[0][0]), scale * (box[1][1] - box[1][0]));
  ctx.setLineDash([]);
  ctx.strokeStyle = ctx.fillStyle = ink("--ink");
  for (const y of machine.x_beams) arrow(ctx, X(reach), Y(y), X(px + half), Y(y));
  for (const x of machine.y_beams) arrow(ctx, X(x), Y(reach), X(x), Y(py + half));
  const seen = [];
  for (const [x, y] of machine.z_beams) {
    const value = deflection(x - px, y - py);
    seen.push(value);
    ctx.beginPath();
    ctx.arc(X(x), Y(y), 5, 0, 2 * Math.PI);
    ctx.fillStyle = `rgb(${diverging(value).join(" ")})`;
    ctx.fill();
    ctx.lineWidth = 1.6;
    ctx.stroke();
  }
  ctx.beginPath();
  ctx.arc(X(px), Y(py), 2.5, 0, 2 * Math.PI);
  ctx.fillStyle = ink("--ink");
  ctx.fill();
  return seen;
}

function arrow(ctx, x0, y0, x1, y1) {
  ctx.lineWidth = 1;
  line(ctx, x0, y0, x1, y1);
  const angle = Math.atan2(y1 - y0, x1 - x0);
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  for (const turn of [2.75, -2.75]) ctx.lineTo(x1 + 6 * Math.cos(angle + turn), y1 + 6 * Math.sin(angle + turn));
  ctx.closePath();
  ctx.fillStyle = ink("--ink");
  ctx.fill();
}

// Where the shape is zero: pieces of lines within each square of its grid.
function nodeLines(ctx, X, Y) {
  const n = machine.n_shape, h = machine.side / (n - 1), o = -machine.side / 2;
  const at = (i, j) => machine.shapes[state.mode * n * n + i * n + j];
  ctx.lineWidth = 1;
  ctx.strokeStyle = ink("--soft");
  for (let i = 0; i + 1 < n; i++) for (let j = 0; j + 1 < n; j++) {
    const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]], cuts = [];
    for (let k = 0; k < 4; k++) {
      const [a, b] = [corners[k], corners[(k + 1) % 4]], va = at(...a), vb = at(...b);
      if (va < 0 !== vb < 0) {
        const s = va / (va - vb);
        cuts.push([o + h * (a[0] + s * (b[0] - a[0])), o + h * (a[1] + s * (b[1] - a[1]))]);
      }
    }
    for (let k = 0; k + 1 < cuts.length; k += 2) line(ctx, X(cuts[k][0]), Y(cuts[k][1]), X(cuts[k + 1][0]), Y(cuts[k + 1][1]));
  }
}
