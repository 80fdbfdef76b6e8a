// The operator's console: connects the two links with what is shown and with the controls.

import { Charts, DOFS } from "./charts.js";
import { ImageView } from "./image.js";
import { Link, readToken } from "./link.js";
import { Sound } from "./sound.js";
import { Steering } from "./steer.js";

const LOST = 500; // ms without a state, or without an image
const MODES = { twin: "SIMULATED", hardware: "REAL MOTORS", replay: "RECORDING" };
const WORDS = {
  ready: "READY", moving: "MOVING", held: "HELD", stopped: "STOPPED", off: "OFF", opening: "ENABLING", lost: "NO DATA",
  replay: "REPLAY",
};
const KEY_NAMES = ["↑ ↓", "← →", "W S"];

const $ = (id) => document.getElementById(id);
document.body.classList.toggle("viewing", new URLSearchParams(location.search).has("view"));

let state = null;
let client = null;
let receivedAt = -Infinity;
let motion = "lost";
let latched = "";
const sequences = { servo: 0, request: 0 };
const sound = new Sound($("sound"));
const token = readToken();

const hasLease = () => state !== null && client !== null && state.holder === client;

/** Fields of a command, with the next sequence of its kind; null without the lease. */
function command(kind) {
  if (!hasLease()) return null;
  sequences[kind] += 1;
  return { lease: state.lease, sequence: sequences[kind], image: view.sequence };
}

function request(fields) {
  const found = command("request");
  if (found) control.send({ ...fields, ...found });
  else reply("Take control first.", true);
}

function reply(text, isRefused) {
  $("reply").textContent = text;
  $("reply").classList.toggle("refused", isRefused);
}

const stop = () => control.send({ type: "stop" });

const control = new Link("/control", token, {
  onMessage(data) {
    const message = JSON.parse(data);
    if (message.type === "welcome") client = message.client;
    else if (message.type === "reply") {
      const { what, is_accepted: isAccepted, reason } = message.reply;
      reply(isAccepted ? `${what}: done` : `${what}: refused, ${reason}`, !isAccepted);
    } else {
      state = { ...message.state, latency: message.latency };
      receivedAt = performance.now();
      charts.add(state);
    }
  },
  onClose() {
    client = null;
  },
});
const video = new Link("/video", token, { onMessage: (data) => view.receive(data) });
const view = new ImageView($("image"), (image, width) => video.send({ type: "drawn", image, width }));
const charts = new Charts($("charts"));
const steering = new Steering({ getCommand: () => command("servo"), send: (message) => control.send(message), onStop: stop });

// Controls

$("stop").addEventListener("click", stop);
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

const rows = DOFS.map(({ name }, k) => {
  $("dofs").insertAdjacentHTML("beforeend", `<span>${name}</span><kbd>${KEY_NAMES[k]}</kbd>
    <input type="range" min="0.05" max="1" step="0.05" aria-label="scale of ${name}"><output></output>
    <label><input type="checkbox" checked> clutch</label>`);
  const [clutch, scale] = ["checkbox", "range"].map((type) => [...$("dofs").querySelectorAll(`[type=${type}]`)].at(-1));
  const output = [...$("dofs").querySelectorAll("output")].at(-1);
  scale.addEventListener("change", () => request({ type: "setting", name: "scale", value: Number(scale.value), dof: name }));
  clutch.addEventListener("change", () =>
    request({ type: "setting", name: "clutch", value: clutch.checked ? 1 : 0, dof: name }));
  return { scale, clutch, output };
});

// What is shown, ten times a second

const show = (input, value) => {
  if (document.activeElement !== input) input.value = value;
};

function megabytes(bytes) {
  return bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
}

function duration(seconds) {
  if (seconds === null) return "–";
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

function facts() {
  const { image, log, late } = state;
  const refused = Object.values(state.refused).reduce((a, b) => a + b, 0);
  const list = {
    profile: state.profile,
    images: `${view.rate.toFixed(1)}/s, ${image.status}`,
    "capture to estimate": `${(1000 * image.age).toFixed(0)} ms`,
    "image to screen": state.latency ? `${state.latency.map((time) => (1000 * time).toFixed(0)).join(" ms, 95 %: ")} ms` : "–",
    "images dropped": image.dropped,
    drives: state.drives,
    "late ticks": late[1] ? `${late[0]} of ${late[1]}` : "–",
    "commands refused": refused,
    log: log.failure || `${megabytes(log.size)}, room for ${duration(log.remaining)}`,
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
  $("latched").replaceChildren(
    ...state.latched.map(([name, meaning]) => {
      const item = document.createElement("li");
      item.textContent = `${meaning} (${name})`;
      return item;
    }),
  );
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
  rows.forEach(({ scale, clutch, output }, k) => {
    show(scale, state.scale[k]);
    output.textContent = `${Math.round(100 * state.scale[k])} %`;
    if (document.activeElement !== clutch) clutch.checked = state.clutch[k];
  });
  $("record").textContent = state.is_recording ? "End take" : "Record";
  $("record").setAttribute("aria-pressed", state.is_recording);
  $("progress").hidden = !state.program;
  $("progress").value = state.progress;
  $("enable").disabled ||= !["stopped", "held", "off"].includes(state.motion);
  $("hint").textContent = hint();
}

function hint() {
  if (!hasLease()) return "Take control to steer. Others watch; everybody may stop.";
  if (!steering.isActive) return "This page does not have the focus: nothing moves.";
  if (["stopped", "held", "off"].includes(state.motion)) return "Press Enable; then hold a key to move.";
  if (state.rested_by) return `Motion ended: ${state.rested_by}. Let go, then hold again.`;
  if (state.must_release) return "Let go of all keys and buttons, then hold one to move.";
  return "Hold a key, or a shoulder button of the gamepad and its sticks, to move. Escape stops.";
}

function update() {
  const isLost = performance.now() - receivedAt > LOST || !control.isOpen;
  const now = isLost ? "lost" : state.motion;
  if (now !== motion) {
    if (now === "lost") sound.play("lost");
    if (["stopped", "held", "off"].includes(now)) sound.play("stopped");
    motion = document.body.dataset.motion = now;
    $("motion").textContent = WORDS[now];
  }
  const isOld = performance.now() - view.drawnAt > LOST;
  $("stale").hidden = !isOld;
  if (isLost) {
    $("message").textContent = "No data from the control process. Motion has stopped; use the emergency stop if not.";
    return;
  }
  $("message").textContent = state.message;
  $("mode").textContent = MODES[state.mode];
  $("mode").dataset.mode = state.mode;
  charts.describe(state);
  showWarnings();
  showLease();
  showControls();
  facts();
}
setInterval(update, 100);
