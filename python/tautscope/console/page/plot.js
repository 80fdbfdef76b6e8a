// One chart on a canvas: axes with round numbers, a grid, and lines. It is drawn anew each time.

export const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const THEMES = {};

/** Colours and size of letters, read once per colour scheme and width of the window. */
function theme() {
  const key = `${matchMedia("(prefers-color-scheme: dark)").matches} ${innerWidth}`;
  THEMES[key] ??= { colours: {}, letter: 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize) };
  return THEMES[key];
}

/** The least of 1, 2, 5 times a power of ten that divides a span into at most `count`. */
function step(span, count) {
  const power = 10 ** Math.floor(Math.log10(span / count));
  return [1, 2, 5, 10].map((each) => each * power).find((each) => each * count >= span * 0.999);
}

/** The ends of lists of numbers, with a margin, at least `size` apart. */
export function ends(lists, size) {
  let [low, high] = [Infinity, -Infinity];
  for (const list of lists) {
    for (const value of list) {
      if (value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  const middle = low <= high ? (low + high) / 2 : 0;
  const half = Math.max((high - low) * 0.55, size / 2);
  return [middle - half, middle + half];
}

/** Draws lines `{x, y, colour, width, dash}` over the ranges `[low, high]`; nulls interrupt a line. */
export function plot(canvas, [left, right], [low, high], lines) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width || !height) return;
  const { colours, letter } = theme();
  const colour = (name) => (colours[name] ??= style(name));
  const ratio = devicePixelRatio;
  const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== across || canvas.height !== down) [canvas.width, canvas.height] = [across, down];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const [start, top, end, bottom] = [3.4 * letter, 1.5 * letter, width - 5, height - 1.6 * letter];
  const [scaleX, scaleY] = [(end - start) / (right - left), (bottom - top) / (high - low)];

  context.font = `${letter}px system-ui, sans-serif`;
  context.fillStyle = colour("dim");
  context.strokeStyle = colour("line");
  context.lineWidth = 0.5;
  context.beginPath();
  const ticks = (from, to, space) => {
    const by = step(to - from, Math.max(space, 3));
    return Array.from({ length: Math.floor(to / by) - Math.ceil(from / by) + 1 }, (_, k) => (Math.ceil(from / by) + k) * by);
  };
  const text = (value) => `${Number(value.toPrecision(4))}`.replace("-", "−");
  context.textAlign = "center";
  for (const value of ticks(left, right, (end - start) / (3.5 * letter))) {
    const x = start + (value - left) * scaleX;
    context.moveTo(x, top);
    context.lineTo(x, bottom);
    context.fillText(text(value), x, height - 0.3 * letter);
  }
  context.textAlign = "right";
  for (const value of ticks(low, high, (bottom - top) / (2 * letter))) {
    const y = bottom - (value - low) * scaleY;
    context.moveTo(start, y);
    context.lineTo(end, y);
    context.fillText(text(value), start - 0.4 * letter, y + 0.35 * letter);
  }
  context.stroke();

  context.save();
  context.beginPath();
  context.rect(start, top - 1, end - start, bottom - top + 2);
  context.clip();
  for (const { x, y, colour: name, width: lineWidth, dash = [] } of lines) {
    context.strokeStyle = colour(name);
    context.lineWidth = lineWidth;
    context.setLineDash(dash);
    context.beginPath();
    let isOpen = false;
    for (let k = 0; k < x.length; k++) {
      if (y[k] === null) isOpen = false;
      else if (isOpen) context.lineTo(start + (x[k] - left) * scaleX, bottom - (y[k] - low) * scaleY);
      else context.moveTo(start + (x[k] - left) * scaleX, bottom - (y[k] - low) * scaleY);
      isOpen ||= y[k] !== null;
    }
    context.stroke();
  }
  context.restore();
}
