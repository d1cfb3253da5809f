// What stands before the object's canvas: a picture for each monitor, and the light. Draws once for all that changed.
import { Compositor, type Drawable, type Standing } from "../light/compositor";

export const kStill: Standing = { keepShape: false, dx: 0, dy: 0, scale: 1 };

export class Stage {
  readonly monitors: { name: string; width: number; height: number }[];
  private readonly compositor: Compositor;
  private readonly standings: Standing[];
  private readonly moved = new Set<number>();
  private gain = 1;
  private waiting = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    matte: Drawable,
  ) {
    this.compositor = new Compositor(canvas, matte);
    this.monitors = matte.metadata.monitors.map(({ name, width_px, height_px }) => ({ name, width: width_px, height: height_px }));
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

  /** The canvas as a PNG, with all that was asked for. */
  picture(): Promise<Blob> {
    this.draw();
    return new Promise((resolve, reject) => {
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("the browser cannot write a PNG"))), "image/png");
    });
  }

  close(): void {
    cancelAnimationFrame(this.waiting);
    this.compositor.close();
  }

  private drawSoon(): void {
    if (this.waiting === 0) this.waiting = requestAnimationFrame(() => this.draw());
  }
  private draw(): void {
    cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    for (const monitor of this.moved) this.compositor.place(monitor, this.standing(monitor));
    this.moved.clear();
    this.compositor.draw(this.gain);
  }
}
