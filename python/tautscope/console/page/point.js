// The image as an input device: while it is held, the tip moves towards the pixel under the pointer.

/** The pixel held on the image of `view`, while `isOffered()`; beyond the image, and when it is not offered, a new press is needed. */
export class Pointing {
  constructor(view, isOffered) {
    Object.assign(this, { view, isOffered });
    this.pointer = null; // the finger or mouse that holds
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.#begin(event));
    canvas.addEventListener("pointermove", (event) => event.pointerId === this.pointer && this.#follow(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      canvas.addEventListener(end, (event) => event.pointerId === this.pointer && this.release());
    }
    canvas.addEventListener("contextmenu", (event) => this.pointer !== null && event.preventDefault());
  }

  #begin(event) {
    if (this.pointer !== null || event.button !== 0 || !this.isOffered()) return;
    this.pointer = event.pointerId;
    this.view.canvas.setPointerCapture(event.pointerId);
    this.#follow(event);
  }

  #follow(event) {
    // Of several buttons of a mouse only the last one released is told.
    this.view.mark = event.buttons & 1 ? this.view.pixel(event.clientX, event.clientY) : null;
    if (!this.view.mark) this.release();
  }

  release() {
    this.pointer = this.view.mark = null;
  }

  get point() {
    if (this.pointer !== null && !this.isOffered()) this.release();
    return this.view.mark;
  }
}
