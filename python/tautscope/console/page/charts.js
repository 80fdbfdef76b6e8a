// Per degree of freedom: reference and tip over time, the loop, the offsets; with uPlot.

const DEGREES = 180 / Math.PI;
const SHOWN = { mm: { scale: 1000, unit: "mm" }, rad: { scale: DEGREES, unit: "°" } };
const LENGTH = 600; // samples
const SAMPLE = 0.04; // s
const FRAME = 40; // ms; one degree of freedom is drawn in each

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** The loop: tip over reference, as a path. */
function xyPath(plot, index) {
  const path = new Path2D();
  uPlot.orient(plot, index, (series, xs, ys, scaleX, scaleY, toX, toY, left, top, width, height) => {
    let isFirst = true;
    for (let k = 0; k < xs.length; k++) {
      const x = toX(xs[k], scaleX, width, left);
      const y = toY(ys[k], scaleY, height, top);
      if (isFirst) path.moveTo(x, y);
      else path.lineTo(x, y);
      isFirst = false;
    }
  });
  return { stroke: path };
}

class DofCharts {
  constructor(dof, parent) {
    this.dof = dof;
    const card = document.createElement("article");
    card.className = "dof";
    const { unit, scale, range } = dof;
    const ends = range?.map((end) => `${Math.round(scale * end)}`.replace("-", "−")).join(" to ");
    card.innerHTML = `<h2><b>${dof.name}</b>${ends ? `<span class="range">${ends} ${unit}</span>` : ""}
      error <b class="error"></b><span class="offsets"></span></h2>`;
    this.error = card.querySelector(".error");
    this.offsets = card.querySelector(".offsets");
    this.boxes = [
      ["over time: reference, command and tip",
        `<span class="reference">reference</span> <span class="command">command</span> <span class="tip">tip</span> <span class="true" hidden>true tip</span> [${unit}]`],
      ["loop of tip over reference", `<span class="tip">tip</span> over reference [${unit}]`],
      ["contact offsets over time", `<span class="offset">contact offsets</span> [${unit}]`],
    ].map(([what, caption]) => {
      const box = document.createElement("div");
      box.className = "chart";
      box.setAttribute("role", "img");
      box.setAttribute("aria-label", `${dof.name}, ${what}`);
      box.innerHTML = `<p aria-hidden="true">${caption}</p>`;
      card.append(box);
      return box;
    });
    parent.append(card);
    this.plots = [];
  }

  rebuild() {
    this.plots.forEach((plot) => plot.destroy());
    const line = (name, width = 1.5) => ({ label: name, stroke: colour(name), width, points: { show: false } });
    const letter = 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize);
    const axis = () => ({
      stroke: colour("dim"), grid: { stroke: colour("line"), width: 0.5 }, ticks: { show: false }, size: 2 * letter,
      font: `${letter}px system-ui`, gap: 2, space: 3.5 * letter,
    });
    const vertical = () => ({ ...axis(), size: 3.6 * letter, space: 2.2 * letter });
    const common = (box, title) => ({
      width: Math.max(box.clientWidth, 40), height: Math.max(box.clientHeight, 40), legend: { show: false },
      cursor: { show: false }, padding: [1.4 * letter, 6, 0, 0], title,
    });
    const least = (size) => (plot, low, high) => {
      const middle = (low + high) / 2 || 0;
      const half = Math.max((high - low) * 0.55 || 0, size / 2);
      return [middle - half, middle + half];
    };
    const { scale } = this.dof;
    const size = this.dof.unit === "mm" ? 2 : 6;
    const [timeBox, loopBox, offsetBox] = this.boxes;
    const time = { time: false, range: (plot, low, high) => [high - LENGTH * SAMPLE, high] };
    this.plots = [
      new uPlot({
        ...common(timeBox), scales: { x: time, y: { range: least(size) } }, axes: [axis(), vertical()],
        series: [{}, line("reference"), line("command", 1), line("tip", 2), line("true", 1)],
      }, [[], [], [], [], []], timeBox),
      new uPlot({
        ...common(loopBox), mode: 2, scales: { x: { time: false, range: least(size) }, y: { range: least(size) } },
        axes: [axis(), vertical()], series: [null, { ...line("tip", 1.5), paths: xyPath }],
      }, [null, [[], []]], loopBox),
      new uPlot({
        ...common(offsetBox), scales: { x: time, y: { range: least(size) } }, axes: [axis(), vertical()],
        series: [{}, line("offset"), line("offset")],
      }, [[], [], []], offsetBox),
    ];
    this.scale = scale;
  }

  draw(times, rows) {
    const { reference, command, tip, true: truth, minus, plus } = rows;
    const [time, loop, offsets] = this.plots;
    time.setData([times, reference, command, tip, truth]);
    loop.setData([null, [reference, tip]]);
    offsets.setData([times, minus, plus]);
  }
}

/** All charts; `add` samples the states, which are drawn one degree of freedom at a time. */
export class Charts {
  constructor(parent, dofs) {
    this.dofs = dofs.map((dof) => ({ ...dof, ...SHOWN[dof.unit] }));
    this.parent = parent;
    this.cards = this.dofs.map((dof) => new DofCharts(dof, parent));
    this.times = [];
    this.rows = dofs.map(() => ({ reference: [], command: [], tip: [], true: [], minus: [], plus: [] }));
    this.next = 0;
    const rebuild = () => this.cards.forEach((card) => card.rebuild());
    rebuild(); // the observer first calls when the page is rendered, which a hidden one is not
    new ResizeObserver(rebuild).observe(parent);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", rebuild);
    setInterval(() => this.#draw(), FRAME);
  }

  add(state) {
    const last = this.times.at(-1) ?? -Infinity;
    if (state.time < last) this.#clear();
    else if (state.time - last < SAMPLE * 0.9) return;
    this.times.push(state.time);
    if (state.true) this.parent.querySelectorAll(".true").forEach((element) => (element.hidden = false));
    this.dofs.forEach(({ scale }, k) => {
      const row = this.rows[k];
      row.reference.push(scale * state.reference[k]);
      row.command.push(scale * state.command[k]);
      row.tip.push(state.tip[k] === null ? null : scale * state.tip[k]);
      row.true.push(state.true ? scale * state.true[k] : null);
      row.minus.push(scale * state.delta_minus[k]);
      row.plus.push(scale * state.delta_plus[k]);
    });
    if (this.times.length > LENGTH) [this.times, ...this.rows.flatMap(Object.values)].forEach((list) => list.shift());
  }

  /** Numbers beside the charts. */
  describe(state) {
    this.dofs.forEach(({ scale, unit }, k) => {
      const number = (value) => (value === null ? "–" : `${(scale * value).toFixed(unit === "mm" ? 2 : 1)} ${unit}`);
      const card = this.cards[k];
      card.error.textContent = state.tip[k] === null ? "–" : number(state.reference[k] - state.tip[k]);
      const deviation = number(state.image.deviation[k]);
      const slack = state.delta_plus[k] - state.delta_minus[k];
      const certainty = state.width_std[k] === null ? "" : ` ± ${number(state.width_std[k])}`;
      card.offsets.textContent = `tip ± ${deviation}, slack ${number(slack)}${certainty}`;
    });
  }

  #clear() {
    [this.times, ...this.rows.flatMap(Object.values)].forEach((list) => (list.length = 0));
  }

  #draw() {
    this.next = (this.next + 1) % this.dofs.length;
    if (this.times.length > 1 && !document.hidden) this.cards[this.next].draw(this.times, this.rows[this.next]);
  }
}
