// The operator's console: connects the two links with what is shown and with the controls.

import { Charts, isOff } from "./charts.js";
import { ImageView } from "./image.js";
import { Link, NO_TOKEN, readToken } from "./link.js";
import { PathView } from "./path.js";
import { Pointing } from "./point.js";
import { Sound } from "./sound.js";
import { Steering, isText } from "./steer.js";

const LOST = 500; // ms without a state, or without an image
const SOUGHT = 300; // ms until the time that was asked for is shown
const REFUSED = 5000; // ms for which a refusal is shown with the state
const MODES = { twin: "SIMULATED", hardware: "REAL MOTORS", replay: "RECORDING" };
const WORDS = {
  ready: "READY", moving: "MOVING", held: "HELD", stopped: "STOPPED", unconfirmed: "MAY MOVE", off: "OFF",
  opening: "ENABLING", lost: "NO DATA", replay: "REPLAY",
};
const RESTING = ["stopped", "unconfirmed", "held", "off"]; // until Enable

const $ = (id) => document.getElementById(id);
document.body.classList.toggle("viewing", new URLSearchParams(location.search).has("view"));

let layout = null;
let charts, steering, rows;
let state = null;
let client = null;
let hasToken = true;
let receivedAt = -Infinity;
let motion = "lost";
let latched = "";
let refusal = null;
let soughtAt = -Infinity;
const sequences = { servo: 0, request: 0 };
const sound = new Sound($("sound"));
const token = readToken();

const hasLease = () => state !== null && client !== null && state.holder === client;

/** Fields of a command, with the next sequence of its kind; null without the lease. */
function command(kind) {
  if (!hasLease()) return null;
  sequences[kind] += 1;
  const image = layout.sees_bands ? view.sequence : state.image.sequence;
  return { lease: state.lease, sequence: sequences[kind], image };
}

function request(fields) {
  const found = command("request");
  if (found) control.send({ ...fields, ...found });
  else reply("Take control first.", true);
}

function reply(text, isRefused) {
  refusal = isRefused ? { text, at: performance.now() } : null;
  $("reply").textContent = text;
  $("reply").classList.toggle("refused", isRefused);
}

/** Go to a time of a recording, or stay, and play on or not. */
const seek = (time, isPlaying) => control.send({ type: "seek", time, is_playing: isPlaying });
const stop = () => {
  if (!control.send({ type: "stop" })) reply("STOP was NOT sent: no connection. Use the emergency stop.", true);
};

const control = new Link("/control", token, {
  onMessage(data) {
    const message = JSON.parse(data);
    if (message.type === "welcome") {
      client = message.client;
      hasToken = true;
      if (!layout) build(message.layout);
    } else if (message.type === "reply") {
      const { what, is_accepted: isAccepted, reason } = message.reply;
      // A control with the focus keeps showing what was asked for; without it, it shows what is.
      if (!isAccepted && !isText(document.activeElement)) document.activeElement?.blur();
      reply(`${what}: ${isAccepted ? "done" : "refused"}${reason && `, ${reason}`}`, !isAccepted);
    } else {
      state = { ...message.state, latency: message.latency };
      receivedAt = performance.now();
      if (isOff(state)) return;
      charts.add(state);
      if (state.positions) path.add(state);
      updates.push([state.time, state.image.updates]);
      if (updates.length > 100) updates.shift();
    }
  },
  onClose(reason) {
    client = null;
    hasToken = reason !== NO_TOKEN;
  },
});
const video = new Link("/video", token, { onMessage: (data) => view.receive(data) });
const view = new ImageView($("image"), (image, width) => video.send({ type: "drawn", image, width }));
const path = new PathView($("path"));
const pointing = new Pointing(view, () =>
  hasLease() && layout.sees_bands && ["ready", "moving"].includes(motion) && steering.isActive);
const updates = []; // time and number of updates, of the newest states

// Controls

// At once when it is touched; a click without a pointer is a key's.
$("stop").addEventListener("pointerdown", stop);
$("stop").addEventListener("click", (event) => event.detail || stop());
$("play").addEventListener("click", () => {
  const [time, duration, isPlaying] = state.replay;
  seek(!isPlaying && time >= duration - 0.1 ? 0 : null, !isPlaying);
});
$("seek").addEventListener("input", () => {
  soughtAt = performance.now();
  seek(Number($("seek").value), state.replay[2]);
});
addEventListener("keydown", (event) => {
  if (event.code === "KeyC" && !event.repeat && !isText(event.target) && !event.ctrlKey && !event.metaKey) $("compensate").click();
});
$("take").addEventListener("click", () => control.send({ type: "take" }));
$("acknowledge").addEventListener("click", () => request({ type: "action", name: "acknowledge" }));
for (const button of document.querySelectorAll("[data-action]")) {
  button.addEventListener("click", () => request({ type: "action", name: button.dataset.action }));
}
$("set_mark").addEventListener("click", () => request({ type: "action", name: "mark", text: $("mark").value }));
const setCompensation = () =>
  request({ type: "setting", name: "compensation", value: $("compensate").checked ? Number($("gain").value) : 0 });
$("compensate").addEventListener("change", setCompensation);
$("gain").addEventListener("change", setCompensation);
$("profile").addEventListener("change", () => request({ type: "profile", profile: $("profile").value }));

/** The page of an instrument. */
function build(found) {
  layout = found;
  const { dofs, programs, sees_bands: seesBands } = layout;
  if (seesBands) document.body.dataset.view = "image";
  document.body.dataset.dofs = dofs.length > 3 ? "many" : "few";
  document.body.style.setProperty("--dofs", dofs.length);
  for (const button of document.querySelectorAll("[data-program]")) button.hidden = !programs.includes(button.dataset.action);
  $("legend").hidden = !seesBands;
  charts = new Charts($("charts"), dofs);
  const send = (message) => control.send(message);
  steering = new Steering({ count: dofs.length, pointing, hasLease, getCommand: () => command("servo"), send, onStop: stop });
  rows = dofs.map(controlsOf);
}

function controlsOf({ name }, k) {
  $("dofs").insertAdjacentHTML("beforeend", `<span>${name}</span><span><kbd></kbd><span class="touch">
    <button aria-label="${name} backwards">−</button> <button aria-label="${name} forwards">+</button></span></span>
    <input type="range" min="0.05" max="1" step="0.05" aria-label="scale of ${name}"><output></output>
    <label><input type="checkbox" checked aria-label="clutch of ${name}"> clutch</label>`);
  const last = (selector) => [...$("dofs").querySelectorAll(selector)].at(-1);
  const [clutch, scale, output, keys] = ["[type=checkbox]", "[type=range]", "output", "kbd"].map(last);
  [...last(".touch").children].forEach((button, side) => steering.bind(button, k, 2 * side - 1));
  scale.addEventListener("change", () => request({ type: "setting", name: "scale", value: Number(scale.value), dof: name }));
  clutch.addEventListener("change", () =>
    request({ type: "setting", name: "clutch", value: clutch.checked ? 1 : 0, dof: name }));
  return { scale, clutch, output, keys };
}

// What is shown, ten times a second

const show = (input, value) => {
  if (document.activeElement !== input) input.value = value;
};

function megabytes(bytes) {
  return bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
}

function duration(seconds) {
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

function facts() {
  const { image, log, late } = state;
  const refused = Object.values(state.refused).reduce((a, b) => a + b, 0);
  const ofImages = layout.sees_bands && {
    "image to screen": state.latency ? `${state.latency.map((time) => (1000 * time).toFixed(0)).join(" ms, 95 %: ")} ms` : "–",
    "images dropped": image.dropped,
  };
  const room = log.remaining === null ? "" : `, room for ${duration(log.remaining)}`;
  const [since, before] = updates[0] ?? [0, 0];
  const measured = state.time > since ? (image.updates - before) / (state.time - since) : 0;
  const list = {
    profile: state.profile,
    [layout.sees_bands ? "images" : "measurements"]:
      `${(layout.sees_bands ? view.rate : measured).toFixed(1)}/s, ${layout.sees_bands || image.updates ? image.status : "none"}`,
    "capture to estimate": image.updates ? `${(1000 * image.age).toFixed(0)} ms` : "–",
    ...ofImages,
    drives: state.drives,
    "late ticks": late[1] ? `${late[0]} of ${late[1]}` : "–",
    "commands refused": refused,
    log: log.failure || (log.path ? `${log.path}, ${megabytes(log.size)}${room}` : "–"),
    "not logged": log.dropped,
  };
  $("facts").innerHTML = Object.keys(list).map(() => "<div><dt></dt><dd></dd></div>").join("");
  [...$("facts").children].forEach((row, k) => {
    row.firstChild.textContent = Object.keys(list)[k];
    row.lastChild.textContent = Object.values(list)[k];
  });
}

function showWarnings() {
  const now = JSON.stringify(state.latched);
  if (now === latched) return;
  if (now.length > latched.length) sound.play("warning");
  latched = now;
  const [first, ...others] = state.latched;
  $("latched").textContent = first ? `${first[1]} (${first[0]})` : "";
  $("others").textContent = others.length ? `Also: ${others.map(([name]) => name).join(", ")}.` : "";
  $("warnings").hidden = state.latched.length === 0;
}

function showLease() {
  const mine = hasLease();
  const text = state.holder === null ? "Nobody has control." : `Page ${state.holder} has control; you watch.`;
  $("lease").textContent = mine ? "You have control." : text;
  $("take").hidden = mine || state.mode === "replay";
  $("take").textContent = state.holder === null ? "Take control" : "Take control from them";
  for (const element of document.querySelectorAll("#controls :is(button, input, select)")) element.disabled = !mine;
  $("acknowledge").disabled = !mine;
}

function showControls() {
  $("device").textContent = steering.device;
  const share = state.compensation;
  if (document.activeElement !== $("compensate")) $("compensate").checked = share > 0;
  if (share > 0) show($("gain"), share);
  $("gain_value").textContent = `${Math.round(100 * share)} %`;
  show($("profile"), state.profile);
  rows.forEach(({ scale, clutch, output, keys }, k) => {
    keys.textContent = steering.keyName(k);
    show(scale, state.scale[k]);
    output.textContent = `${Math.round(100 * state.scale[k])} %`;
    if (document.activeElement !== clutch) clutch.checked = state.clutch[k];
  });
  $("record").textContent = state.is_recording ? "End take" : "Record";
  $("record").setAttribute("aria-pressed", state.is_recording);
  $("progress").hidden = !state.program;
  $("progress").value = state.progress;
  $("program").textContent = state.program ? `${state.program}: ${Math.round(100 * state.progress)} %` : state.program_ended;
  const shares = state.score.map((errors) => (errors?.[1] ? `${Math.round(100 * (1 - errors[0] / errors[1]))} %` : "–")).join(", ");
  $("score").textContent = state.score.some(Boolean)
    ? `Last minute: ${shares} less error than without (by ${state.uncompensated_by}).`
    : "Move for a second to compare with the tip without compensation.";
  $("enable").disabled ||= !RESTING.includes(state.motion);
  $("hint").textContent = hint();
}

function hint() {
  if (!hasLease()) return "Take control to steer. Others watch; everybody may stop.";
  if (!steering.isActive) return "This page does not have the focus: nothing moves.";
  if (RESTING.includes(state.motion)) return "Press Enable; then hold a key to move.";
  if (state.rested_by) return `Motion ended: ${state.rested_by}. Let go, then hold again.`;
  if (state.is_off_centre) return "A stick of the gamepad is off centre: let go of it. If it stays, unplug the gamepad: it is worn.";
  if (isText(document.activeElement)) return "Keys write into the text field; click beside it to steer by them.";
  if (state.must_release) return "Let go of all keys and buttons, then hold one to move.";
  const pick = rows.length > 3 ? ` Keys 3 to ${rows.length}, or the pad's cross, pick what W S and the right stick move.` : "";
  return `Hold a key, − or +, or a shoulder button of the gamepad and its sticks, to move. Escape stops.${pick}`;
}

function showPointing() {
  $("pointing").hidden = Boolean(state.replay);
  for (const element of [$("pointing"), $("image")]) element.classList.toggle("offered", pointing.isOffered());
}

function showTime() {
  $("timeline").hidden = !state.replay;
  $("controls").hidden = Boolean(state.replay);
  if (!state.replay) return;
  const [time, length, isPlaying] = state.replay;
  $("seek").max = length;
  if (!$("seek").matches(":active") && performance.now() - soughtAt > SOUGHT) $("seek").value = time;
  $("at").textContent = `${time.toFixed(1)} of ${length.toFixed(1)} s`;
  $("play").textContent = isPlaying ? "Pause" : "Play";
}

function update() {
  const isLost = performance.now() - receivedAt > LOST || !control.isOpen;
  const now = isLost ? "lost" : state.motion;
  if (now !== motion) {
    if (now === "lost") sound.play("lost");
    if (RESTING.includes(now)) sound.play("stopped");
    motion = document.body.dataset.motion = now;
    $("motion").textContent = WORDS[now];
  }
  if (!hasToken) $("message").textContent = "This address has no valid token: open the one that the console printed.";
  if (!layout) return;
  const hasImage = layout.sees_bands || view.sequence > 0;
  const isOld = performance.now() - view.drawnAt > LOST;
  $("stale").hidden = !isOld || !hasImage || (!isLost && state.replay !== null && !state.replay[2]);
  if (isLost) {
    if (hasToken) $("message").textContent = "No data from the control process. What this page moved rests; another page may steer. If in doubt, use the emergency stop.";
    return;
  }
  const isRefused = refusal && performance.now() - refusal.at < REFUSED;
  $("message").textContent = [state.message, isRefused && refusal.text].filter(Boolean).join(" — ");
  $("mode").textContent = MODES[state.mode];
  $("mode").dataset.mode = state.mode;
  document.body.dataset.view = hasImage ? "image" : state.positions ? "path" : "none";
  for (const element of document.querySelectorAll(".picture")) element.hidden = !hasImage;
  charts.describe(state);
  showWarnings();
  showLease();
  showControls();
  // In Firefox it would swallow every key, also Escape.
  if (document.activeElement?.disabled) document.activeElement.blur();
  showTime();
  showPointing();
  facts();
}
setInterval(update, 100);
