// The operator's input: keyboard, gamepad and touch, sent every 20 ms while this page has the lease and the focus.

const PERIOD = 20; // ms
const DEAD_BAND = 0.1;
// Two degrees of freedom have keys and a stick of their own; the third pair moves the one picked of the others.
const PICKED = 2;
const KEYS = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowRight: [1, 1], ArrowLeft: [1, -1], KeyW: [PICKED, 1], KeyS: [PICKED, -1],
};
const KEY_NAMES = ["↑ ↓", "← →", "W S"];
const ENABLING = [4, 5]; // shoulder buttons of a standard gamepad
const PICK = { 14: -1, 15: 1 }; // its directional pad, left and right
const STOP = 1;
const AXES = [[1, -1], [0, 1], [3, -1]]; // index and sign: left stick up and right, right stick up

const isText = (element) => element instanceof Element && element.matches("input, select, textarea");

/** A stick's deflection without the dead band around its centre. */
export function deflection(value) {
  const size = Math.abs(value);
  return size <= DEAD_BAND ? 0 : (Math.sign(value) * Math.min(1, (size - DEAD_BAND))) / (1 - DEAD_BAND);
}

/** Sends the input for `count` axes; `getCommand` returns the fields of a command, or null without the lease. */
export class Steering {
  constructor({ count, getCommand, send, onStop }) {
    Object.assign(this, { count, getCommand, send, onStop });
    this.pressed = new Map(); // key or button -> axis and sign
    this.picked = PICKED;
    this.device = "keyboard";
    this.wasDown = new Set(); // buttons of the gamepad
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
    if (isText(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
    const digit = /^(?:Digit|Numpad)([1-9])$/.exec(event.code);
    if (digit) this.pick(Number(digit[1]) - 1);
    if (!(event.code in KEYS)) return;
    event.preventDefault();
    const [slot, sign] = KEYS[event.code];
    if (!event.repeat) this.#hold(event.code, this.axis(slot), sign);
  }

  #hold(name, axis, sign) {
    if (axis < this.count) this.pressed.set(name, [axis, sign]);
  }

  /** Let W and S, and the right stick, move another axis; nothing that is held goes on. */
  pick(axis) {
    if (axis < PICKED || axis >= this.count) return;
    this.pressed.clear();
    this.picked = axis;
  }

  /** The axis that a pair of keys or a stick moves. */
  axis(slot) {
    return slot === PICKED ? this.picked : slot;
  }

  /** What a person presses to move an axis: its keys, or the key that picks it. */
  keyName(axis) {
    return axis < PICKED || axis === this.picked ? KEY_NAMES[Math.min(axis, PICKED)] : `${axis + 1}`;
  }

  /** Move an axis while a button is touched or clicked. */
  bind(button, axis, sign) {
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      this.#hold(button, axis, sign);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      button.addEventListener(end, () => this.pressed.delete(button));
    }
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  /** Rest at once: the page is hidden, or another window has the focus. */
  #release() {
    this.pressed.clear();
    this.#send([], false);
  }

  get isActive() {
    return document.visibilityState === "visible" && document.hasFocus();
  }

  #tick() {
    const pad = [...navigator.getGamepads()].find((each) => each?.connected);
    const down = new Set([...(pad?.buttons ?? []).keys()].filter((k) => pad.buttons[k].pressed));
    const isEnabled = ENABLING.some((button) => down.has(button));
    const begins = (button) => down.has(button) && !this.wasDown.has(button);
    if (begins(STOP)) this.onStop();
    for (const [button, step] of Object.entries(PICK)) {
      if (begins(Number(button)) && !isEnabled) this.pick(this.picked + step);
    }
    this.wasDown = down;
    if (!this.isActive) return;
    this.device = pad ? `gamepad, ${pad.id.slice(0, 30)}` : "keyboard";
    const moves = isEnabled
      ? AXES.map(([index, sign], slot) => [this.axis(slot), sign * deflection(pad.axes[index] ?? 0)])
      : [...this.pressed.values()];
    this.#send(moves, isEnabled || this.pressed.size > 0);
  }

  #send(moves, isHolding) {
    const axes = Array(this.count).fill(0);
    for (const [axis, value] of moves) if (axis < this.count) axes[axis] += value;
    const command = this.getCommand();
    if (command) this.send({ type: "servo", ...command, axes: axes.map((a) => a || 0), is_holding: isHolding });
  }
}
