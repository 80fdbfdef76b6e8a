// The operator's input: keyboard and gamepad, sent every 20 ms while this page has the lease and the focus.

const PERIOD = 20; // ms
const DEAD_BAND = 0.1;
const KEYS = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowRight: [1, 1], ArrowLeft: [1, -1], KeyW: [2, 1], KeyS: [2, -1],
};
const ENABLING = [4, 5]; // shoulder buttons of a standard gamepad
const STOP = 1;
const AXES = [[1, -1], [0, 1], [3, -1]]; // index and sign: left stick up and right, right stick up

const isText = (element) => element instanceof Element && element.matches("input, select, textarea");

/** A stick's deflection without the dead band around its centre. */
export function deflection(value) {
  const size = Math.abs(value);
  return size <= DEAD_BAND ? 0 : (Math.sign(value) * Math.min(1, (size - DEAD_BAND))) / (1 - DEAD_BAND);
}

/** Sends the input; `getCommand` returns the fields of a command, or null without the lease. */
export class Steering {
  constructor({ getCommand, send, onStop }) {
    Object.assign(this, { getCommand, send, onStop });
    this.pressed = new Set();
    this.device = "keyboard";
    this.wasStop = false;
    addEventListener("keydown", (event) => this.#press(event), true);
    addEventListener("keyup", (event) => this.pressed.delete(event.code), true);
    const release = () => this.#release();
    addEventListener("blur", release);
    document.addEventListener("visibilitychange", release);
    addEventListener("pagehide", release);
    setInterval(() => this.#tick(), PERIOD);
  }

  #press(event) {
    if (event.code === "Escape") {
      this.onStop();
      return;
    }
    if (!(event.code in KEYS) || isText(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (!event.repeat) this.pressed.add(event.code);
  }

  /** Rest at once: the page is hidden, or another window has the focus. */
  #release() {
    this.pressed.clear();
    this.#send([0, 0, 0], false);
  }

  get isActive() {
    return document.visibilityState === "visible" && document.hasFocus();
  }

  #tick() {
    const pad = [...navigator.getGamepads()].find((each) => each?.connected);
    const isStop = Boolean(pad?.buttons[STOP]?.pressed);
    if (isStop && !this.wasStop) this.onStop();
    this.wasStop = isStop;
    if (!this.isActive) return;
    this.device = pad ? `gamepad, ${pad.id.slice(0, 30)}` : "keyboard";
    if (pad && ENABLING.some((button) => pad.buttons[button]?.pressed)) {
      this.#send(AXES.map(([index, sign]) => sign * deflection(pad.axes[index] ?? 0)), true);
      return;
    }
    const axes = [0, 0, 0];
    for (const code of this.pressed) {
      const [axis, sign] = KEYS[code];
      axes[axis] += sign;
    }
    this.#send(axes, this.pressed.size > 0);
  }

  #send(axes, isHolding) {
    const command = this.getCommand();
    if (command) this.send({ type: "servo", ...command, axes: axes.map((a) => a || 0), is_holding: isHolding });
  }
}
