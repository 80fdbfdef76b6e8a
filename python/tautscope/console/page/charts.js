// Per degree of freedom: reference and tip over time, the loops with and without compensation, the offsets.

import { ends, plot } from "./plot.js";

const SHOWN = { mm: { scale: 1000, unit: "mm", size: 2, digits: 2 }, rad: { scale: 180 / Math.PI, unit: "°", size: 6, digits: 1 } };
const LENGTH = 600; // samples
const SAMPLE = 0.04; // s
const GAP = 1; // s without a sample: another time of a recording
const FRAME = 40; // ms; one degree of freedom is drawn in each
const SERIES = { // name in a chart -> in the state
  reference: "reference", command: "command", tip: "tip", true: "true", without: "uncompensated", minus: "delta_minus", plus: "delta_plus",
};
const WITHOUT = { colour: "without", width: 1.5, dash: [5, 3] };
const TIP = { colour: "tip", width: 2.5 };
const sign = (name, text) => `<span class="${name}">${text}</span>`;
const CAPTIONS = [
  ["reference, command and tip over time", `${sign("reference", "reference")}${sign("command", "command")}${sign("tip", "tip")}${sign("true", "true tip")}`],
  ["loop of the tip over the reference, with and without compensation", `${sign("tip", "tip")}${sign("without", "without")}`],
  ["contact offsets over time", sign("offset", "contact offsets")],
];

/** Whether the rig is off: there is no tick of it, and zeros stand for what is not known. */
export const isOff = ({ replay, late }) => !replay && !late[1];

/** All charts; `add` samples the states, which are drawn one degree of freedom at a time. */
export class Charts {
  constructor(parent, dofs) {
    this.parent = parent;
    this.dofs = dofs.map((dof) => ({ ...dof, ...SHOWN[dof.unit] }));
    this.cards = this.dofs.map((dof) => this.#card(dof));
    this.times = [];
    this.rows = dofs.map(() => Object.fromEntries(Object.keys(SERIES).map((name) => [name, []])));
    this.next = 0;
    this.#show(0);
    setInterval(() => this.#draw(), FRAME);
  }

  #card({ name, unit, scale, range }) {
    const card = document.createElement("article");
    card.className = "dof";
    const reach = range?.map((end) => `${Math.round(scale * end)}`.replace("-", "−")).join(" to ");
    card.innerHTML = `<h2><b>${name}</b> error <b class="error"></b>
      <span class="offsets"></span>${reach ? `<span class="range">${reach} ${unit}</span>` : ""}</h2><p class="score"></p>`;
    for (const [what, caption] of CAPTIONS) {
      card.insertAdjacentHTML("beforeend", `<div class="chart"><p aria-hidden="true">${caption} [${unit}]</p>
        <canvas role="img" aria-label="${name}, ${what}"></canvas></div>`);
    }
    this.parent.append(card);
    return card;
  }

  add(state) {
    const last = this.times.at(-1) ?? state.time - SAMPLE;
    if (state.time < last || state.time > last + GAP) this.#clear();
    else if (state.time - last < SAMPLE * 0.9) return;
    this.times.push(state.time);
    this.parent.classList.toggle("knows", state.true !== null);
    const travel = this.dofs.map(({ scale, size }, k) => {
      for (const [name, list] of Object.entries(this.rows[k])) {
        const value = state[SERIES[name]]?.[k] ?? null;
        list.push(value === null ? null : scale * value);
      }
      const { reference } = this.rows[k];
      return Math.abs(reference.at(-1) - (reference.at(-2) ?? reference.at(-1))) / size;
    });
    if (travel[this.shown] === 0 && Math.max(...travel) > 0) this.#show(travel.indexOf(Math.max(...travel)));
    if (this.times.length > LENGTH) [this.times, ...this.rows.flatMap(Object.values)].forEach((list) => list.shift());
  }

  /** A small window has room for the charts of one degree of freedom: the one that moves, or moved last. */
  #show(index) {
    this.shown = index;
    this.cards.forEach((card, k) => card.classList.toggle("moved", k === index));
  }

  /** Numbers beside the charts. */
  describe(state) {
    this.dofs.forEach(({ scale, unit, digits }, k) => {
      // What rounds to zero has no sign.
      const rounded = (value) => (Number((scale * value).toFixed(digits)) || 0).toFixed(digits).replace("-", "−");
      const number = (value) => (value === null ? "–" : `${rounded(value)} ${unit}`);
      const show = (name, text) => (this.cards[k].querySelector(name).textContent = text);
      show(".error", state.tip[k] === null ? "–" : number(state.reference[k] - state.tip[k]));
      const slack = isOff(state) ? null : state.delta_plus[k] - state.delta_minus[k];
      const certainty = state.width_std[k] === null ? "" : ` ± ${number(state.width_std[k])}`;
      show(".offsets", `tip ± ${number(state.image.deviation[k])}, slack ${number(slack)}${certainty}`);
      const score = state.score[k]?.map(number);
      const none = isOff(state) ? "–" : "Not moved yet";
      show(".score", score ? `Last minute: ${score[0]} off; without compensation ${score[1]}` : none);
    });
  }

  #clear() {
    [this.times, ...this.rows.flatMap(Object.values)].forEach((list) => (list.length = 0));
  }

  #draw() {
    this.next = (this.next + 1) % this.dofs.length;
    const { times, dofs: { [this.next]: { size } } } = this;
    if (!times.length || document.hidden) return;
    const [time, loops, offsets] = this.cards[this.next].querySelectorAll("canvas");
    const { reference, command, tip, true: truth, without, minus, plus } = this.rows[this.next];
    const range = [times.at(-1) - LENGTH * SAMPLE, times.at(-1)];
    plot(time, range, ends([reference, command, tip], size), [
      { x: times, y: command, colour: "command", width: 1, dash: [1, 2] },
      { x: times, y: tip, ...TIP },
      { x: times, y: truth, colour: "true", width: 1 },
      { x: times, y: reference, colour: "reference", width: 1.2 },
    ]);
    plot(loops, ends([reference], size), ends([tip, without], size), [
      { x: reference, y: without, ...WITHOUT },
      { x: reference, y: tip, ...TIP },
    ]);
    plot(offsets, range, ends([minus, plus], size), [minus, plus].map((y) => ({ x: times, y, colour: "offset", width: 1.5 })));
  }
}
