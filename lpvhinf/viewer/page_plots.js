// Canvases: sizes, colours, axes, curves and poles.

const LIGHT = ["#0072b2", "#d55e00", "#009e73", "#a8487f", "#8a6a00", "#3a8fc4", "#5a6068"];
const DARK = ["#56b4e9", "#f08c4a", "#2bc79a", "#e3a5c7", "#f0e442", "#9db7ff", "#c3c8ce"];
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3], [4, 4], [12, 4], [1, 3]];

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

const colourOf = (design) => (isDark() ? DARK : LIGHT)[design.index % LIGHT.length];
const dashOf = (design) => DASHES[design.index % DASHES.length];
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A context in CSS pixels, its canvas as large as its box.
function context(canvas) {
  const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(scale, 0, 0, scale, 0, 0);
  ctx.clearRect(0, 0, width, height);
  ctx.font = "11px system-ui, sans-serif";
  return { ctx, width, height };
}

// A coordinate system with margins, linear or logarithmic axes, its grid and labels.
function frame(canvas, { x, y, xlog = false, ylog = false, xlabel, ylabel }) {
  const { ctx, width, height } = context(canvas);
  const left = 44, right = 8, top = 8, bottom = 32;
  const scale = (log, [low, high], from, to) => {
    const f = log ? Math.log10 : (v) => v;
    const a = f(low), b = f(high);
    return (v) => from + ((f(v) - a) / (b - a)) * (to - from);
  };
  const X = scale(xlog, x, left, width - right), Y = scale(ylog, y, height - bottom, top);
  ctx.lineWidth = 1;
  ctx.fillStyle = ink("--soft");
  for (const [value, label, minor] of ticks(x, xlog, (width - left) / 70)) {
    ctx.strokeStyle = ink("--grid");
    ctx.globalAlpha = minor ? 0.5 : 1;
    line(ctx, X(value), top, X(value), height - bottom);
    ctx.globalAlpha = 1;
    if (label) text(ctx, label, X(value), height - bottom + 13, "center");
  }
  for (const [value, label, minor] of ticks(y, ylog, height / 45)) {
    ctx.strokeStyle = ink("--grid");
    ctx.globalAlpha = minor ? 0.5 : 1;
    line(ctx, left, Y(value), width - right, Y(value));
    ctx.globalAlpha = 1;
    if (label) text(ctx, label, left - 5, Y(value) + 4, "right");
  }
  text(ctx, xlabel, 0.5 * (left + width - right), height - 4, "center");
  ctx.save();
  ctx.translate(11, 0.5 * (top + height - bottom));
  ctx.rotate(-Math.PI / 2);
  text(ctx, ylabel, 0, 0, "center");
  ctx.restore();
  ctx.strokeStyle = ink("--line");
  ctx.strokeRect(left, top, width - right - left, height - bottom - top);
  const inside = (draw) => {
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width - right - left, height - bottom - top);
    ctx.clip();
    draw();
    ctx.restore();
  };
  return { ctx, X, Y, left, right: width - right, top, bottom: height - bottom, inside };
}

function line(ctx, x0, y0, x1, y1) {
  ctx.beginPath();
  ctx.moveTo(x0, y0);
  ctx.lineTo(x1, y1);
  ctx.stroke();
}

function text(ctx, label, x, y, align) {
  ctx.textAlign = align;
  ctx.fillText(label, x, y);
}

function ticks([low, high], log, count) {
  const out = [];
  if (log) {
    for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++) {
      for (let m = 1; m < 10; m++) {
        const value = m * 10 ** e;
        if (value >= low * 0.999 && value <= high * 1.001) out.push([value, m === 1 ? plain(value) : "", m !== 1]);
      }
    }
    return out;
  }
  const rough = (high - low) / Math.max(2, count), unit = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * unit).find((s) => s >= rough);
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push([k * step, plain(k * step), false]);
  return out;
}

// A number without needless digits.
function plain(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(0);
  return String(Number(value.toPrecision(6)));
}

const limits = {};

// Limits [dB] of the curves of a name: fixed over P, so that what moves is the curve.
function decibels(name, partner) {
  if (limits[name]) return limits[name];
  let low = Infinity, high = -Infinity;
  for (const design of designs) {
    for (const each of partner ? [name, partner] : [name]) {
      const found = range(design, each);
      if (found) for (let k = 0; k < hertz.length; k++) {
        if (found.high[k] > high) high = found.high[k];
        if (found.low[k] < low) low = found.low[k];
      }
    }
  }
  high = Math.min(Math.ceil((high + 3) / 10) * 10, 100);
  low = Math.max(Math.floor((low - 3) / 10) * 10, high - (partner ? 160 : 100));
  return (limits[name] = [low, high]);
}

// Singular values against frequency; `partner` is drawn thinner.
function drawCurves(canvas, name, partner, bands) {
  const f = frame(canvas, {
    x: [hertz[0], hertz[hertz.length - 1]], xlog: true, y: decibels(name, partner), xlabel: "frequency [Hz]",
    ylabel: "largest singular value [dB]".replace("largest ", partner ? "" : "largest "),
  });
  const { ctx, X, Y } = f;
  const x = Float32Array.from(hertz, X);
  f.inside(() => {
    ctx.strokeStyle = ink("--soft");
    if (decibels(name, partner)[0] < 0) line(ctx, f.left, Y(0), f.right, Y(0));
    for (const design of designs) {
      if (!design.shown) continue;
      ctx.strokeStyle = ctx.fillStyle = colourOf(design);
      for (const [each, width] of partner ? [[name, 1.8], [partner, 1]] : [[name, 1.8]]) {
        const values = curve(design, each);
        if (!values) continue;
        if (bands) {
          const over = range(design, each);
          ctx.globalAlpha = 0.13;
          ctx.beginPath();
          for (let k = 0; k < x.length; k++) ctx.lineTo(x[k], Y(over.high[k]));
          for (let k = x.length - 1; k >= 0; k--) ctx.lineTo(x[k], Y(over.low[k]));
          ctx.fill();
          ctx.globalAlpha = 1;
        }
        ctx.lineWidth = width;
        ctx.setLineDash(dashOf(design));
        ctx.beginPath();
        for (let k = 0; k < x.length; k++) ctx.lineTo(x[k], Y(values[k]));
        ctx.stroke();
        ctx.setLineDash([]);
      }
    }
  });
  return f;
}

// Highest frequency of a plant's modes that the views of the poles have to show [Hz].
const topMode = machine ? Math.max(...machine.hertz) * 1.15 : hertz[hertz.length - 1];
const VIEWS = {
  damping: { x: [1, 2 * topMode], xlog: true, y: [1e-3, 1.3], ylog: true, xlabel: "natural frequency [Hz]", ylabel: "damping ratio" },
  near: { x: [-400, 50], y: [0, topMode], xlabel: "real part [1/s]", ylabel: "imaginary part [Hz]" },
  all: { xlabel: "real part [1/s]", ylabel: "imaginary part [Hz]" },
};

function poleView(name) {
  const view = VIEWS[name];
  if (name === "all" && !view.x) {
    let re = -1, im = 1;
    for (const design of designs) for (let k = 0; k < design.poles.length; k += 2) {
      re = Math.min(re, design.poles[k]);
      im = Math.max(im, design.poles[k + 1]);
    }
    view.x = [1.05 * re, -0.05 * re];
    view.y = [0, (1.05 * im) / (2 * Math.PI)];
  }
  return view;
}

function polePoint(name, re, im) {
  if (name !== "damping") return [re, im / (2 * Math.PI)];
  const size = Math.hypot(re, im);
  return [size / (2 * Math.PI), -re / size];
}

// Poles at the nearest position, over those of the whole grid.
function drawPoles(canvas, name, bands) {
  const f = frame(canvas, poleView(name));
  const { ctx, X, Y } = f, here = nearest(state.p);
  f.inside(() => {
    ctx.strokeStyle = ink("--soft");
    ctx.lineWidth = 1;
    if (name !== "damping") line(ctx, X(0), f.top, X(0), f.bottom);
    for (const design of designs) {
      if (!design.shown) continue;
      ctx.fillStyle = ctx.strokeStyle = colourOf(design);
      if (bands) {
        ctx.globalAlpha = 0.22;
        for (let k = 0; k < design.poles.length; k += 2) {
          const [a, b] = polePoint(name, design.poles[k], design.poles[k + 1]);
          if (name === "damping" && !(a > 0 && b > 0)) continue;
          ctx.fillRect(X(a) - 1, Y(b) - 1, 2, 2);
        }
        ctx.globalAlpha = 1;
      }
      ctx.lineWidth = 1.6;
      const poles = polesAt(design, here);
      for (let k = 0; k < poles.length; k += 2) {
        const [a, b] = polePoint(name, poles[k], poles[k + 1]);
        if (name === "damping" && !(a > 0 && b > 0)) continue;
        mark(ctx, X(a), Y(b), design.index);
      }
    }
  });
}

// A cross, a plus, a square, a diamond: designs differ in more than colour.
function mark(ctx, x, y, index) {
  const r = 3.6;
  if (index % 4 === 0) {
    line(ctx, x - r, y - r, x + r, y + r);
    line(ctx, x - r, y + r, x + r, y - r);
  } else if (index % 4 === 1) {
    line(ctx, x - r - 1, y, x + r + 1, y);
    line(ctx, x, y - r - 1, x, y + r + 1);
  } else if (index % 4 === 2) {
    ctx.strokeRect(x - r, y - r, 2 * r, 2 * r);
  } else {
    ctx.beginPath();
    ctx.moveTo(x - r - 1, y);
    ctx.lineTo(x, y - r - 1);
    ctx.lineTo(x + r + 1, y);
    ctx.lineTo(x, y + r + 1);
    ctx.closePath();
    ctx.stroke();
  }
}
