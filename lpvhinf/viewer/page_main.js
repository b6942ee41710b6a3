// The page itself: controls, keyboard and pointer, and what is drawn when.

const get = (id) => document.getElementById(id);
const PANELS = [
  ["S", "Sensitivity S", null],
  ["SG", "Process sensitivity, rigid-body forces to e", null],
  ["SGF", "Process sensitivity, modal forces to e", null],
  ["L", "Open loop (largest, thin: smallest)", "Lmin"],
];
const panels = PANELS.filter(([name]) => designs.some((design) => design.curves[name])).map(([name, title, partner]) => {
  const figure = document.createElement("figure");
  figure.innerHTML = '<figcaption></figcaption><div class="drawing"><canvas role="img"></canvas></div>';
  const caption = figure.querySelector("figcaption"), value = document.createElement("span");
  caption.append(title, value);
  get("curves").append(figure);
  return { name, title, partner, value, canvas: figure.querySelector("canvas"), at: null };
});

const names = ["x", "y"];
const round = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "-");

function peak(values) {
  let best = 0;
  for (let k = 1; k < values.length; k++) if (values[k] > values[best]) best = k;
  return [values[best], hertz[best]];
}

function slowest(design) {
  const poles = polesAt(design, nearest(state.p));
  let zeta = Infinity;
  for (let k = 0; k < poles.length; k += 2) {
    if (poles[k + 1] > 0) zeta = Math.min(zeta, -poles[k] / Math.hypot(poles[k], poles[k + 1]));
  }
  return zeta;
}

function drawPanels() {
  for (const panel of panels) {
    panel.frame = drawCurves(panel.canvas, panel.name, panel.partner, get("bands").checked);
    const said = designs.filter((d) => d.shown && d.curves[panel.name]).map((d) => {
      const [high, where] = peak(curve(d, panel.name));
      return `${d.name}: peak ${round(high, 1)} dB at ${round(where, 0)} Hz`;
    });
    panel.canvas.setAttribute("aria-label", `${panel.title}. ${said.join("; ")}`);
    if (panel.at !== null) showValue(panel);
  }
}

// Values at the frequency under the pointer.
function showValue(panel) {
  let best = 0;
  for (let k = 1; k < hertz.length; k++) {
    if (Math.abs(Math.log(hertz[k] / panel.at)) < Math.abs(Math.log(hertz[best] / panel.at))) best = k;
  }
  const values = designs.filter((d) => d.shown && d.curves[panel.name]).map((d) => round(curve(d, panel.name)[best], 1));
  panel.value.textContent = `${plain(Number(hertz[best].toPrecision(4)))} Hz: ${values.join(", ")} dB`;
  const { ctx, X, top, bottom } = panel.frame;
  ctx.strokeStyle = ink("--soft");
  ctx.lineWidth = 1;
  line(ctx, X(hertz[best]), top, X(hertz[best]), bottom);
}

function drawTable() {
  const rows = designs.map((design) => {
    const [high, where] = peak(curve(design, "S")), here = design.abscissa[nearest(state.p)];
    const most = Math.max(...design.abscissa), zeta = slowest(design);
    const cell = (value, bad) => `<td${bad ? ' class="bad"' : ""}>${value}</td>`;
    return `<tr><th scope="row"></th>${cell(round(high, 2))}${cell(round(where, 0))}${cell(round(zeta, 4), zeta < 0)}` +
      `${cell(here.toPrecision(3), here >= 0)}${cell(most.toPrecision(3), most >= 0)}${cell(round(design.gamma, 3))}</tr>`;
  });
  get("table").innerHTML = `<thead><tr><th scope="col">design</th><th scope="col">peak of S dB</th><th scope="col">at Hz</th>` +
    `<th scope="col">least damping</th><th scope="col">largest real part 1/s</th><th scope="col">over the grid 1/s</th>` +
    `<th scope="col">gamma</th></tr></thead><tbody>${rows.join("")}</tbody>`;
  get("table").querySelectorAll("tbody th").forEach((cell, k) => (cell.textContent = designs[k].name));
}

function drawClaim() {
  const claim = certificates[state.claim];
  if (!claim) {
    get("claim-text").textContent = "";
    return;
  }
  const cell = cellAt(claim, state.p);
  const here = cell < 0 ? "no cell here" : !claim.proved[cell] ? "not proved here"
    : Number.isFinite(claim.margins[cell]) ? `margin ${claim.margins[cell].toPrecision(3)} here` : "proved here";
  const more = claim.left_out ? `; ${claim.left_out} cells are not shown` : "";
  get("claim-text").textContent = `${claim.outcome}: ${claim.claim} (${claim.n_cells} cells, ${here}${more})`;
}

function drawShape() {
  if (!machine || !planar) return;
  const seen = drawMover(get("mover"));
  const values = seen.map((value, k) => `z${k + 1} ${round(value, 2)}`).join(", ");
  const label = `Mode ${state.mode + 1} at ${machine.hertz[state.mode]} Hz; vertical beams see ${values} of its largest deflection.`;
  get("mover-text").textContent = label;
  get("mover").setAttribute("aria-label", label);
}

function drawPolePanel() {
  drawPoles(get("pole-plot"), get("pole-view").value, get("bands").checked);
  const index = nearest(state.p), at = [Math.floor(index / shape[1]), index % shape[1]];
  const where = axes.map((axis, k) => round(MM * axis[at[k]], 1)).join(", ");
  const unstable = designs.filter((d) => d.shown && d.abscissa[index] >= 0).map((d) => d.name);
  const said = `At the nearest position of the grid, ${where} mm.` +
    (unstable.length ? ` Not stable: ${unstable.join(", ")}.` : " All are stable.");
  get("pole-text").textContent = said;
  get("pole-text").classList.toggle("bad", unstable.length > 0);
  get("pole-plot").setAttribute("aria-label", `Closed-loop poles. ${said}`);
}

let waiting = false;

// Draw everything, at most once a frame.
function update() {
  const parts = state.p.map((value, k) => `p${names[k]} ${round(MM * value, 2)}`).join(", ");
  get("readout").textContent = `${parts} mm`;
  state.p.forEach((value, k) => (get(`slide${k}`).querySelector("input").value = MM * value));
  if (!waiting) {
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }
}

function draw() {
  drawMap(get("map").querySelector("canvas"));
  drawPanels();
  drawPolePanel();
  drawShape();
  drawTable();
  drawClaim();
}

function moveTo(p) {
  state.p = p.slice(0, box.length).map((value, k) => Math.min(Math.max(value, box[k][0]), box[k][1]));
  update();
}

function buildControls() {
  get("subtitle").textContent = `${raw.title}: ${designs.map((d) => d.name).join(", ")}`;
  document.title = `${raw.title}: closed loops over P`;
  [0, 1].forEach((k) => {
    const label = get(`slide${k}`), input = label.querySelector("input");
    label.hidden = k >= box.length;
    if (label.hidden) return;
    Object.assign(input, { min: MM * box[k][0], max: MM * box[k][1], step: (MM * (box[k][1] - box[k][0])) / 240 });
    input.addEventListener("input", () => moveTo(state.p.map((value, i) => (i === k ? input.valueAsNumber / MM : value))));
  });
  get("map").classList.toggle("line", !planar);
  const legend = get("designs");
  for (const design of designs) {
    const label = document.createElement("label"), box_ = document.createElement("input"), note = document.createElement("small");
    box_.type = "checkbox";
    box_.checked = true;
    box_.addEventListener("change", () => {
      design.shown = box_.checked;
      update();
    });
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    note.textContent = `${design.architecture}, gamma ${round(design.gamma, 2)}`;
    const words = document.createElement("span");
    words.append(design.name, " ", note);
    label.append(box_, swatch, words);
    legend.append(label);
  }
  const select = get("claims").querySelector("select");
  get("claims").hidden = !certificates.length;
  [...certificates.keys(), -1].forEach((k) => {
    const claim = certificates[k], short = claim && `${claim.design}: ${claim.claim.split(" at ")[0].split(" for ")[0]}`;
    select.add(new Option(claim ? `${short} (${claim.outcome})` : "none", k));
  });
  select.addEventListener("change", () => {
    state.claim = Number(select.value);
    update();
  });
  if (machine && planar) {
    document.querySelector(".shape").hidden = false;
    machine.hertz.forEach((f, k) => get("mode").add(new Option(`${k + 1}: ${f} Hz${k < machine.controlled ? ", controlled" : ""}`, k)));
    get("mode").addEventListener("change", () => {
      state.mode = Number(get("mode").value);
      update();
    });
  }
  for (const id of ["bands", "pole-view"]) get(id).addEventListener("change", update);
  get("theme").addEventListener("click", () => {
    document.documentElement.dataset.theme = isDark() ? "light" : "dark";
    paintLegend();
    update();
  });
}

function paintLegend() {
  document.querySelectorAll(".swatch").forEach((swatch, k) => {
    const dash = dashOf(designs[k]).join(" ");
    swatch.innerHTML = `<svg width="34" height="12" aria-hidden="true"><line x1="1" y1="6" x2="33" y2="6" stroke="${colourOf(designs[k])}"` +
      ` stroke-width="2.5" stroke-dasharray="${dash}"/></svg>`;
  });
}

function listen() {
  const map = get("map");
  map.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };
    const turn = turns[event.key];
    if (event.key === "Home") moveTo(box.map(([low, high]) => 0.5 * (low + high)));
    else if (turn) {
      const share = event.shiftKey ? 1 / 12 : 1 / 60;
      moveTo(state.p.map((value, k) => value + turn[k] * share * (box[k][1] - box[k][0])));
    } else return;
    event.preventDefault();
  });
  const follow = (event) => {
    const area = map.getBoundingClientRect();
    moveTo(mapScale(area.width, area.height).back(event.clientX - area.left, event.clientY - area.top));
  };
  let dragging = false;
  map.addEventListener("pointerdown", (event) => {
    dragging = true;
    try {
      map.setPointerCapture(event.pointerId);
    } catch {
      // a pointer that is gone already cannot be captured, and need not be
    }
    map.focus({ preventScroll: true });
    follow(event);
    event.preventDefault();
  });
  map.addEventListener("pointermove", (event) => dragging && follow(event));
  for (const end of ["pointerup", "pointercancel"]) map.addEventListener(end, () => (dragging = false));
  for (const panel of panels) {
    panel.canvas.addEventListener("pointermove", (event) => {
      const area = panel.canvas.getBoundingClientRect(), { left, right } = panel.frame;
      const share = Math.min(Math.max((event.clientX - area.left - left) / (right - left), 0), 1);
      panel.at = hertz[0] * (hertz[hertz.length - 1] / hertz[0]) ** share;
      update();
    });
    panel.canvas.addEventListener("pointerleave", () => {
      panel.at = null;
      panel.value.textContent = "";
      update();
    });
  }
  new ResizeObserver(update).observe(document.querySelector("main"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    paintLegend();
    update();
  });
}

function writeNotes() {
  const between = designs.map((d) => `${d.name} ${d.deviation.S.peak} dB for S and ${d.deviation.SG.peak} dB for its product with the plant`);
  const notes = [
    "All curves are singular values in the scaled units of the design, in which the expected error of every axis is 1. They come from the stored closed loops, polynomials of p.",
    `Between the ${shape[0]}${planar ? ` x ${shape[1]}` : ""} positions of the grid (dots on the map) singular values are interpolated, ${planar ? "bilinear" : "linear"} in dB. ` +
      `Recomputed at ${designs[0].deviation.S.n} other positions they differ, within 6 dB of their peak, by at most: ${between.join("; ")}.`,
    "Poles are those of the nearest position of the grid, not interpolated; small dots are those of the whole grid.",
    "The open loop is that at the error e, with the loop of an observer closed: the inverse of S, less one.",
  ];
  if (certificates.length) notes.push("A certificate holds for every position of its cells; the colour is the margin of the scaled inequality. Check its file with: lpvhinf check FILE.");
  if (machine && planar) notes.push("Mode shapes are those of the mover's model, seen from above, over both layers of coils; the dashed square is P, where the mover's centre may be. Dots are the vertical beams, arrows the horizontal ones; thin lines are nodes.");
  for (const note of notes) {
    const item = document.createElement("li");
    item.textContent = note;
    get("notes").append(item);
  }
}

buildControls();
paintLegend();
writeNotes();
listen();
draw();
update();
document.documentElement.dataset.firstDraw = performance.now().toFixed(1);
