// The paths of tip and reference from two sides, for instruments without an image.

const SAMPLE = 0.04; // s
const LENGTH = 600; // samples
const FRAME = 100; // ms
const LEAST = 0.02; // m, shown across at least
const COLOURS = { reference: "#ffffff", uncompensated: "#ff9a2e", true: "#5dff7a", tip: "#4fb4ff" };
const SIDES = [["x", 0], ["y", 1]]; // over z

export class PathView {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.#clear();
    this.time = -Infinity;
    setInterval(() => this.#draw(), FRAME);
  }

  #clear() {
    this.path = [];
    this.ends = [[0, 0], [0, 0], [0, 0]]; // of all points since, with the guide's end
  }

  add(state) {
    if (state.time < this.time) this.#clear();
    else if (state.time - this.time < SAMPLE * 0.9) return;
    this.time = state.time;
    this.path.push(state.positions);
    if (this.path.length > LENGTH) this.path.shift();
    for (const point of Object.values(state.positions)) {
      point?.forEach((value, axis) => {
        const [low, high] = this.ends[axis];
        this.ends[axis] = [Math.min(low, value), Math.max(high, value)];
      });
    }
  }

  #draw() {
    const { canvas, context, ends } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height || !this.path.length || document.hidden) return;
    [canvas.width, canvas.height] = [width * devicePixelRatio, height * devicePixelRatio];
    context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    context.font = "13px system-ui";
    const size = (axis) => Math.max(ends[axis][1] - ends[axis][0], LEAST);
    const isWide = width > 1.6 * height;
    const [across, down] = isWide ? [width / 2, height] : [width, height / 2];
    const scale = Math.min((across - 90) / size(2), (down - 70) / Math.max(size(0), size(1)));
    SIDES.forEach(([name, axis], k) => {
      const [left, top] = isWide ? [k * across, 0] : [0, k * down];
      const middle = (ends[axis][0] + ends[axis][1]) / 2;
      const start = left + (across - scale * (ends[2][1] - ends[2][0])) / 2;
      const place = (point) => [start + scale * (point[2] - ends[2][0]), top + down / 2 - scale * (point[axis] - middle)];
      this.#side(name, place, [left, top, across, down], scale);
    });
  }

  #side(name, place, [left, top, width, height], scale) {
    const { context } = this;
    context.strokeStyle = "#3a4149";
    context.lineWidth = 1;
    context.strokeRect(left + 4.5, top + 4.5, width - 9, height - 9);
    const length = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1].findLast((each) => each * scale < width / 3) ?? 0.001;
    context.fillStyle = "#cfd6dd";
    context.fillText(`${name} over z`, left + 14, top + 24);
    context.fillRect(left + width - 14 - length * scale, top + 18, length * scale, 2);
    const text = `${1000 * length} mm`;
    context.fillText(text, left + width - 14 - context.measureText(text).width, top + 36);
    const [x, y] = place([0, 0, 0]);
    context.fillRect(x - 6, y - 7, 6, 14); // the guide's end
    for (const [kind, colour] of Object.entries(COLOURS)) {
      context.strokeStyle = context.fillStyle = colour;
      context.lineWidth = 1.2;
      context.setLineDash(kind === "uncompensated" ? [5, 3] : []);
      context.globalAlpha = 0.7;
      context.beginPath();
      for (const each of this.path) if (each[kind]) context.lineTo(...place(each[kind]));
      context.stroke();
      context.setLineDash([]);
      context.globalAlpha = 1;
      const now = this.path.at(-1)[kind];
      if (!now) continue;
      context.beginPath();
      context.arc(...place(now), kind === "reference" ? 8 : 4, 0, 2 * Math.PI);
      if (kind === "reference") context.stroke();
      else context.fill();
    }
  }
}
