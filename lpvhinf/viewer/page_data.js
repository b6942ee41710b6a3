"use strict";
// What Python computed, unpacked into typed arrays, and values between the positions of the grid.

const raw = JSON.parse(document.getElementById("data").textContent);

function bytes(text) {
  const binary = atob(text), out = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) out[i] = binary.charCodeAt(i);
  return out.buffer;
}

const hertz = new Float32Array(bytes(raw.hertz));
const axes = raw.axes, box = raw.box, planar = axes.length === 2;
const shape = [axes[0].length, planar ? axes[1].length : 1];
const MM = 1000;

const designs = raw.designs.map((it, index) => {
  const curves = {};
  for (const [name, text] of Object.entries(it.curves)) curves[name] = new Int16Array(bytes(text));
  const starts = [0];
  for (const count of it.counts) starts.push(starts[starts.length - 1] + count);
  return {
    ...it, index, curves, starts, shown: true,
    poles: new Float32Array(bytes(it.poles)), abscissa: new Float32Array(bytes(it.abscissa)),
  };
});

const certificates = raw.certificates.map((it) => ({
  ...it, cells: new Float32Array(bytes(it.cells)), proved: new Int8Array(bytes(it.proved)),
  margins: new Float32Array(bytes(it.margins)),
}));

const machine = raw.machine && { ...raw.machine, shapes: new Int8Array(bytes(raw.machine.shapes)) };

const state = { p: box.map(([low, high]) => 0.5 * (low + high)), claim: certificates.length ? 0 : -1, mode: 0 };

// Where a coordinate lies on an axis of the grid: lower index and share of the way to the next one.
function place(axis, value) {
  const n = axis.length;
  const at = Math.min(Math.max(((value - axis[0]) / (axis[n - 1] - axis[0])) * (n - 1), 0), n - 1);
  const low = Math.min(Math.floor(at), n - 2);
  return [low, at - low];
}

// Positions of the grid about p, with bilinear weights.
function around(p) {
  const [i, a] = place(axes[0], p[0]);
  const [j, b] = planar ? place(axes[1], p[1]) : [0, 0];
  const out = [];
  for (const [k, s] of [[i, 1 - a], [i + 1, a]]) {
    for (const [l, t] of planar ? [[j, 1 - b], [j + 1, b]] : [[0, 1]]) if (s * t > 0) out.push([k * shape[1] + l, s * t]);
  }
  return out;
}

// The index of the nearest position of the grid.
function nearest(p) {
  let best = 0, most = -1;
  for (const [index, weight] of around(p)) if (weight > most) [best, most] = [index, weight];
  return best;
}

// Singular values [dB] of a design at p; null where it has none of this name.
function curve(design, name, p = state.p) {
  const stored = design.curves[name], n = hertz.length;
  if (!stored) return null;
  const out = new Float32Array(n);
  for (const [index, weight] of around(p)) {
    const w = weight * raw.step, at = index * n;
    for (let k = 0; k < n; k++) out[k] += w * stored[at + k];
  }
  return out;
}

// Poles [real, imaginary] of the upper half plane at a position of the grid.
function polesAt(design, index) {
  return design.poles.subarray(2 * design.starts[index], 2 * design.starts[index + 1]);
}

// Smallest and largest value at every frequency over the grid.
function range(design, name) {
  const stored = design.curves[name], n = hertz.length;
  if (!stored) return null;
  design.ranges = design.ranges || {};
  if (design.ranges[name]) return design.ranges[name];
  const low = new Float32Array(n).fill(Infinity), high = new Float32Array(n).fill(-Infinity);
  for (let at = 0, k = 0; at < stored.length; at++) {
    const value = stored[at] * raw.step;
    if (value < low[k]) low[k] = value;
    if (value > high[k]) high[k] = value;
    if (++k === n) k = 0;
  }
  return (design.ranges[name] = { low, high });
}

// The cell of a certificate that holds p, or -1.
function cellAt(claim, p) {
  for (let i = 0; i < claim.proved.length; i++) {
    const at = 4 * i, c = claim.cells;
    const slack = 1e-7;
    if (p[0] >= c[at] - slack && p[0] <= c[at + 1] + slack && p[1] >= c[at + 2] - slack && p[1] <= c[at + 3] + slack) {
      return i;
    }
  }
  return -1;
}
