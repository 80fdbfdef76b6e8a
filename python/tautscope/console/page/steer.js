// The operator's input: keyboard, gamepad and touch, sent every 20 ms while this page has the lease and the focus.

const PERIOD = 20; // ms
const REST = 0.2; // deflection, as DEAD_BAND of operator_input.py
const UNKNOWN = ": its buttons are not known; each stops, and nothing of it moves";
// Two degrees of freedom have keys and a stick of their own; the third pair moves the one picked of the others.
const PICKED = 2;
const KEYS = {
  ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowRight: [1, 1], ArrowLeft: [1, -1], KeyW: [PICKED, 1], KeyS: [PICKED, -1],
};
const KEY_NAMES = ["↑ ↓", "← →", "W S"];
// Of a gamepad whose `mapping` is "standard"; the numbers of any other mean something else on each.
const ENABLING = [4, 5]; // shoulder buttons
const PICK = { 14: -1, 15: 1 }; // directional pad, left and right
const STOP = 1;
const AXES = [[1, -1], [0, 1], [3, -1]]; // index and sign: left stick up and right, right stick up

/** Whether keys are typed into an element. With the lease all others leave the keys that move to the instrument. */
export const isText = (element) => element instanceof Element && element.matches("input:not([type]), textarea");
const bounded = (value) => (Number.isFinite(value) ? Math.max(-1, Math.min(1, value)) : 1);
const isKnown = (pad) => pad.mapping === "standard";

/** Sends the input for `count` axes, or the pixel of `pointing`; `getCommand` returns the fields of a command, or null without the lease. */
export class Steering {
  constructor({ count, pointing, hasLease, getCommand, send, onStop }) {
    Object.assign(this, { count, pointing, hasLease, getCommand, send, onStop });
    this.pressed = new Map(); // key or button -> axis and sign
    this.picked = PICKED;
    this.device = "keyboard";
    this.wasDown = new Map(); // index of a gamepad -> its buttons
    this.pad = ""; // the gamepad in use
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
    if (event.metaKey) this.pressed.clear(); // macOS does not tell which keys are released meanwhile
    if (isText(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
    const digit = /^(?:Digit|Numpad)([1-9])$/.exec(event.code);
    if (digit) this.pick(Number(digit[1]) - 1);
    if (!(event.code in KEYS) || !this.hasLease()) return; // as in a recording: there keys move the timeline
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
    this.pointing.release();
    this.#send([], false);
  }

  get isActive() {
    return document.visibilityState === "visible" && document.hasFocus();
  }

  #tick() {
    const pads = [...navigator.getGamepads()].filter((each) => each?.connected);
    const pad = pads.find(isKnown);
    const begun = new Map(pads.map((each) => [each, this.#begun(each)]));
    // Which button of an unknown device means STOP nobody knows: each does.
    if (pads.some((each) => (isKnown(each) ? begun.get(each).has(STOP) : begun.get(each).size))) this.onStop();
    const isEnabled = ENABLING.some((button) => pad?.buttons[button]?.pressed);
    for (const [button, step] of Object.entries(PICK)) {
      if (!isEnabled && begun.get(pad)?.has(Number(button))) this.pick(this.picked + step);
    }
    if (!this.isActive) return;
    this.device = pads.length ? pads.map((each) => `${each.id.slice(0, 30)}${isKnown(each) ? "" : UNKNOWN}`).join("; ") : "keyboard";
    // An axis that is no number counts as one that does not rest.
    const sticks = AXES.map(([index, sign], slot) => [this.axis(slot), pad ? sign * bounded(pad.axes[index]) : 0]);
    const name = pad ? `${pad.index} ${pad.id}` : "";
    this.hasRested = name === this.pad && (this.hasRested || (!isEnabled && sticks.every(([, value]) => Math.abs(value) < REST)));
    this.pad = name;
    const isMoved = isEnabled && this.hasRested;
    const { point } = this.pointing;
    if (point && !isMoved && !this.pressed.size) this.#send([], true, point);
    else this.#send(isMoved || !this.pressed.size ? sticks : [...this.pressed.values()], isMoved || this.pressed.size > 0);
  }

  /** The buttons of a gamepad that are pressed since now. */
  #begun(pad) {
    const down = new Set([...pad.buttons.keys()].filter((button) => pad.buttons[button].pressed));
    const before = this.wasDown.get(pad.index) ?? new Set();
    this.wasDown.set(pad.index, down);
    return new Set([...down].filter((button) => !before.has(button)));
  }

  #send(moves, isHolding, point = null) {
    const axes = Array(this.count).fill(0);
    for (const [axis, value] of moves) if (axis < this.count) axes[axis] = Math.max(-1, Math.min(1, axes[axis] + value));
    const command = this.getCommand();
    if (command) this.send({ type: "servo", ...command, axes: axes.map((a) => a || 0), is_holding: isHolding, point });
  }
}
