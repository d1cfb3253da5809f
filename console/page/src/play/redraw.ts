// Coalesces changes into one drawing, which starts once the previous one is done. Moving pictures may be drawn with less care, on
// slow devices also coarser; once they rest they are drawn as they are.
import { Pace } from "./pace";

/** Time after the last change until the picture counts as still. */
const kRest_ms = 200;

export interface Drawing {
  /** True once everything that was drawn is on the canvas. */
  isDone: () => boolean;
  /** `step`: every how many pixels along both sides one is drawn. `moving`: another picture may follow at once. */
  draw: (step: number, moving: boolean) => void;
}

export class Redraw {
  private readonly pace: Pace;
  /** A change is not drawn yet, or only coarsely. */
  private isOld = false;
  private isRough = false;
  private changed_ms = 0;
  private prepares = false;
  private drawing: { step: number; since_ms: number; counts: boolean } | undefined;
  private waiting = 0;

  /** `side_px`: the picture's longer side. The canvas is busy until everything is drawn. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    side_px: number,
    private readonly to: Drawing,
    /** Drawing takes care of moving pictures. */
    private readonly hurries = false,
  ) {
    this.pace = new Pace(side_px);
  }

  /** `prepares`: more than a picture is to be drawn, so that its time says nothing of the next one's. */
  soon(prepares = false): void {
    this.prepares ||= prepares;
    if (prepares && this.drawing) this.drawing.counts = false; // which waits for it
    this.canvas.ariaBusy = "true";
    this.isOld = true;
    this.changed_ms = performance.now();
    this.look();
  }
  /** At full resolution. */
  now(): void {
    this.draw(1, false);
  }
  close(): void {
    cancelAnimationFrame(this.waiting);
  }

  private look(): void {
    if (this.waiting === 0) this.waiting = requestAnimationFrame(() => this.onFrame());
  }
  private onFrame(): void {
    this.waiting = 0;
    if (!this.to.isDone()) return this.look();
    const now = performance.now();
    if (this.drawing?.counts) this.pace.took(this.drawing.step, now - this.drawing.since_ms);
    this.drawing = undefined;
    if (this.isOld) this.draw(this.pace.step, true);
    else if (this.isRough && now - this.changed_ms > kRest_ms) this.draw(1, false);
    if (this.drawing || this.isRough) this.look();
    else this.canvas.ariaBusy = "false";
  }
  private draw(step: number, moving: boolean): void {
    this.to.draw(step, moving);
    if (!moving && this.hurries) this.pace.forget();
    // The pace is that of moving pictures.
    this.drawing = { step, since_ms: performance.now(), counts: !this.prepares && (moving || !this.hurries) };
    this.prepares = false;
    this.isOld = false;
    this.isRough = step > 1 || (moving && this.hurries);
  }
}
