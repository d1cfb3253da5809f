// The backgrounds, one for each monitor, and the light. Coalesces changes into one drawing, which starts once the previous
// one is done; on slow devices moving pictures are drawn coarser.
import { Compositor, type Drawable, type Standing } from "../light/compositor";
import { fillUnsolved } from "../light/fill_unsolved";
import type { Box } from "../light/matte";
import { Pace } from "./pace";

export const kStill: Standing = { keepShape: false, dx: 0, dy: 0, scale: 1 };

/** Time after the last change until the picture counts as still. */
const kRest_ms = 200;

export class Stage {
  readonly monitors: { name: string; width: number; height: number }[];
  private readonly compositor: Compositor;
  private readonly standings: Standing[];
  private readonly moved = new Set<number>();
  private gain = 1;
  private unsolved: Uint32Array;
  private seeing: Box;
  private readonly pace: Pace;
  /** A change is not drawn yet, or only coarsely. */
  private isOld = false;
  private isCoarse = false;
  private changed_ms = 0;
  private drawing: { step: number; since_ms: number } | undefined;
  private waiting = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    matte: Drawable,
  ) {
    this.compositor = new Compositor(canvas, matte);
    [this.unsolved, this.seeing] = [matte.unsolved, matte.seeing];
    this.pace = new Pace(Math.max(matte.width, matte.height));
    this.monitors = matte.metadata.monitors.map(({ name, width_px, height_px }) => ({
      name,
      width: width_px,
      height: height_px,
    }));
    this.standings = this.monitors.map(() => kStill);
  }

  get mostPictureSide(): number {
    return this.compositor.mostPictureSide;
  }
  standing(monitor: number): Standing {
    return this.standings[monitor]!;
  }
  setMatte(matte: Drawable): void {
    this.compositor.setMatte(matte);
    [this.unsolved, this.seeing] = [matte.unsolved, matte.seeing];
    this.drawSoon();
  }
  setPicture(monitor: number, image: ImageBitmap): void {
    this.compositor.setPicture(monitor, image);
    this.move(monitor, this.standing(monitor));
  }
  move(monitor: number, standing: Standing): void {
    this.standings[monitor] = standing;
    this.moved.add(monitor);
    this.drawSoon();
  }
  setExposure(stops: number): void {
    this.gain = 2 ** stops;
    this.drawSoon();
  }

  /**
   * The canvas as a PNG, once everything requested is drawn. `fill`: the unsolved pixels from their neighbours. `crop`: to
   * the pixels that see a monitor's picture.
   */
  picture(fill: boolean, crop: boolean): Promise<Blob> {
    this.draw(1);
    const copy = new OffscreenCanvas(this.canvas.width, this.canvas.height);
    const pen = copy.getContext("2d")!;
    pen.drawImage(this.canvas, 0, 0);
    if (fill) {
      const pixels = pen.getImageData(0, 0, copy.width, copy.height);
      fillUnsolved(pixels, this.unsolved);
      pen.putImageData(pixels, 0, 0);
    }
    if (!crop) return copy.convertToBlob({ type: "image/png" });
    const { x, y, width, height } = this.seeing;
    const part = new OffscreenCanvas(width, height);
    part.getContext("2d")!.drawImage(copy, -x, -y);
    return part.convertToBlob({ type: "image/png" });
  }

  close(): void {
    cancelAnimationFrame(this.waiting);
    this.compositor.close();
  }

  private drawSoon(): void {
    this.canvas.ariaBusy = "true";
    this.isOld = true;
    this.changed_ms = performance.now();
    this.look();
  }
  private look(): void {
    if (this.waiting === 0) this.waiting = requestAnimationFrame(() => this.onFrame());
  }
  private onFrame(): void {
    this.waiting = 0;
    if (!this.compositor.isDone) return this.look();
    const now = performance.now();
    if (this.drawing) this.pace.took(this.drawing.step, now - this.drawing.since_ms);
    this.drawing = undefined;
    if (this.isOld) this.draw(this.pace.step);
    else if (this.isCoarse && now - this.changed_ms > kRest_ms) this.draw(1);
    if (this.drawing || this.isCoarse) this.look();
    else this.canvas.ariaBusy = "false";
  }
  private draw(step: number): void {
    for (const monitor of this.moved) this.compositor.place(monitor, this.standing(monitor));
    this.moved.clear();
    this.compositor.draw(this.gain, step);
    this.drawing = { step, since_ms: performance.now() };
    this.isOld = false;
    this.isCoarse = step > 1;
  }
}
