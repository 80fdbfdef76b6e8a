// The endoscope's image with the bands as measured and predicted, the tip, and the reference.

const COLOURS = { measured: "#5dff7a", predicted: "#e6e6e6", tip: "#4fb4ff", target: "#ffffff", without: "#ff9a2e", mark: "#ffe14d" };

/** Draws the newest image; `onDrawn` gets the sequence of every image that is on the screen, and its width there. */
export class ImageView {
  constructor(canvas, onDrawn) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false, desynchronized: true });
    this.onDrawn = onDrawn;
    this.sequence = 0;
    this.drawnAt = -Infinity;
    this.size = [1, 1];
    this.mark = null; // the pixel pointed at
    this.waiting = null;
    this.isBusy = false;
    this.drawn = [];
    this.painted = new MessageChannel();
    this.painted.port1.onmessage = (event) => this.onDrawn(event.data, this.shownWidth);
  }

  /** A message of the video connection: length of the overlay, overlay, JPEG. */
  receive(data) {
    this.waiting = data;
    if (!this.isBusy) this.#show();
  }

  async #show() {
    this.isBusy = true;
    while (this.waiting) {
      const data = this.waiting;
      this.waiting = null;
      const length = new DataView(data).getUint32(0, true);
      const overlay = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
      const blob = new Blob([new Uint8Array(data, 4 + length)], { type: "image/jpeg" });
      let bitmap;
      try {
        bitmap = await createImageBitmap(blob);
      } catch {
        this.onDrawn(overlay.sequence, this.shownWidth); // or the server would wait for it
        continue;
      }
      await new Promise((resolve) => requestAnimationFrame(resolve));
      this.#draw(bitmap, overlay);
      bitmap.close();
    }
    this.isBusy = false;
  }

  #draw(bitmap, overlay) {
    const { canvas, context } = this;
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
    }
    // The overlay has the camera's pixels, of which the bitmap may have a part.
    const { width, height } = overlay;
    this.size = [width, height];
    context.setTransform(bitmap.width / width, 0, 0, bitmap.height / height, 0, 0);
    context.drawImage(bitmap, 0, 0, width, height);
    context.lineWidth = Math.max(1.5, height / 380);
    this.#outlines(overlay.predicted, COLOURS.predicted, [6, 4]);
    this.#outlines(overlay.measured, COLOURS.measured, []);
    const { tip, target, uncompensated_tip: without } = overlay;
    const radius = height / 60;
    if (without && tip && Math.hypot(without[0] - tip[0], without[1] - tip[1]) > radius / 2) {
      this.#outlines(overlay.uncompensated, COLOURS.without, [], true);
      this.#line([[without[0] - radius, without[1] - radius], [without[0] + radius, without[1] + radius]], COLOURS.without);
      this.#line([[without[0] - radius, without[1] + radius], [without[0] + radius, without[1] - radius]], COLOURS.without);
    }
    if (tip && target) this.#line([tip, target], COLOURS.target);
    if (target) this.#circle(target, radius, COLOURS.target);
    if (tip) this.#circle(tip, radius / 2.5, COLOURS.tip, true);
    if (this.mark) {
      const [u, v] = this.mark;
      this.#line([[u - radius, v], [u + radius, v]], COLOURS.mark);
      this.#line([[u, v - radius], [u, v + radius]], COLOURS.mark);
    }
    this.sequence = overlay.sequence;
    this.drawnAt = performance.now();
    this.drawn.push(this.drawnAt);
    if (this.drawn.length > 50) this.drawn.shift();
    // Delivered after the frame has been painted.
    this.painted.port2.postMessage(overlay.sequence);
  }

  /** Pixels of the screen across the image, as `object-fit: contain` shows it. */
  get shownWidth() {
    const { clientWidth, clientHeight } = this.canvas;
    return Math.ceil(devicePixelRatio * Math.min(clientWidth, (clientHeight * this.size[0]) / this.size[1]));
  }

  /** The camera's pixel at a place of the window; null beside the image. */
  pixel(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const [width, height] = this.size;
    const scale = Math.min(box.width / width, box.height / height);
    const [u, v] = [width / 2 + (x - box.x - box.width / 2) / scale, height / 2 + (y - box.y - box.height / 2) / scale];
    return u >= 0 && v >= 0 && u <= width && v <= height ? [u, v] : null;
  }

  /** Images per second of the last 50; 0 if there was none for a second. */
  get rate() {
    const times = this.drawn;
    if (times.length < 2 || performance.now() - this.drawnAt > 1000) return 0;
    return (1000 * (times.length - 1)) / (times.at(-1) - times[0]);
  }

  #outlines(outlines, colour, dashes, isFilled = false) {
    const { context } = this;
    context.setLineDash(dashes);
    context.fillStyle = `${colour}66`;
    for (const outline of outlines) {
      this.#line([...outline, outline[0]], colour);
      if (isFilled) context.fill();
    }
    this.context.setLineDash([]);
  }

  #line(points, colour) {
    const { context } = this;
    context.strokeStyle = colour;
    context.beginPath();
    points.forEach(([u, v], k) => (k ? context.lineTo(u, v) : context.moveTo(u, v)));
    context.stroke();
  }

  #circle([u, v], radius, colour, isFilled = false) {
    const { context } = this;
    context.strokeStyle = context.fillStyle = colour;
    context.beginPath();
    context.arc(u, v, radius, 0, 2 * Math.PI);
    if (isFilled) context.fill();
    else context.stroke();
  }
}
