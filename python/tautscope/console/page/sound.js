// Alarms as tones; browsers allow them after the first key or click.

const TONES = { warning: [880, 880], stopped: [440, 330, 440, 330], lost: [330, 220] };
const LENGTH = 0.14; // s

export class Sound {
  constructor(button) {
    this.isOn = true;
    this.context = null;
    button.addEventListener("click", () => {
      this.isOn = !this.isOn;
      button.setAttribute("aria-pressed", this.isOn);
      button.textContent = this.isOn ? "Sound on" : "Sound off";
    });
    const start = () => (this.context ??= new AudioContext());
    addEventListener("pointerdown", start, { once: true });
    addEventListener("keydown", start, { once: true });
  }

  play(name) {
    if (!this.isOn || !this.context) return;
    TONES[name].forEach((frequency, k) => {
      const tone = this.context.createOscillator();
      const volume = this.context.createGain();
      const at = this.context.currentTime + k * LENGTH * 1.3;
      tone.frequency.value = frequency;
      volume.gain.value = 0.15;
      tone.connect(volume).connect(this.context.destination);
      tone.start(at);
      tone.stop(at + LENGTH);
    });
  }
}
