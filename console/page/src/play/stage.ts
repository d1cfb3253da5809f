// The backgrounds, one for each monitor, and the light.
import { Compositor, type Drawable, type Standing } from "../light/compositor";
import { fillUnsolved } from "../light/fill_unsolved";
import type { Box } from "../light/matte";
import { Redraw } from "./redraw";

export const kStill: Standing = { keepShape: false, dx: 0, dy: 0, scale: 1 };

export class Stage {
  readonly monitors: { name: string; width: number; height: number }[];
  private readonly compositor: Compositor;
  private readonly standings: Standing[];
  private readonly moved = new Set<number>();
  private gain = 1;
  private cropped = false;
  private matte: Drawable;
  private readonly redraw: Redraw;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    matte: Drawable,
  ) {
    this.matte = matte;
    this.compositor = new Compositor(canvas, matte);
    this.redraw = new Redraw(
      canvas,
      Math.max(matte.width, matte.height),
      { isDone: () => this.compositor.isDone, draw: (step, moving) => this.draw(step, moving) },
      true,
    );
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
    this.matte = matte;
    this.compositor.setMatte(matte);
    this.compositor.view = this.view;
    this.redraw.soon(true);
  }
  /** `on`: only the pixels that see a monitor's picture are shown, and downloaded. */
  setCrop(on: boolean): void {
    this.cropped = on;
    this.compositor.view = this.view;
    this.redraw.soon();
  }
  /** Of the matte's width. */
  get shownShare(): number {
    return (this.view?.width ?? this.matte.width) / this.matte.width;
  }
  /** The part of the matte that is shown; undefined: all of it. */
  get view(): Box | undefined {
    return this.cropped ? this.matte.seeing : undefined;
  }
  setPicture(monitor: number, image: ImageBitmap): void {
    this.compositor.setPicture(monitor, image);
    this.moved.add(monitor);
    this.redraw.soon(true);
  }
  move(monitor: number, standing: Standing): void {
    this.standings[monitor] = standing;
    this.moved.add(monitor);
    this.redraw.soon();
  }
  setExposure(stops: number): void {
    this.gain = 2 ** stops;
    this.redraw.soon();
  }

  /** What is shown as a PNG, once everything requested is drawn. `fill`: the unsolved pixels from their neighbours. */
  picture(fill: boolean): Promise<Blob> {
    this.compositor.view = undefined; // pixels are filled from those beyond the crop, too
    this.redraw.now();
    const copy = new OffscreenCanvas(this.canvas.width, this.canvas.height);
    const pen = copy.getContext("2d")!;
    pen.drawImage(this.canvas, 0, 0);
    if (fill) {
      const pixels = pen.getImageData(0, 0, copy.width, copy.height);
      fillUnsolved(pixels, this.matte.unsolved);
      pen.putImageData(pixels, 0, 0);
    }
    if (!this.view) return copy.convertToBlob({ type: "image/png" });
    this.compositor.view = this.view;
    this.redraw.now();
    const { x, y, width, height } = this.view;
    const part = new OffscreenCanvas(width, height);
    part.getContext("2d")!.drawImage(copy, -x, -y);
    return part.convertToBlob({ type: "image/png" });
  }

  close(): void {
    this.redraw.close();
    this.compositor.close();
  }

  private draw(step: number, moving: boolean): void {
    for (const monitor of this.moved) this.compositor.place(monitor, this.standing(monitor));
    this.moved.clear();
    this.compositor.draw(this.gain, step, moving);
  }
}
