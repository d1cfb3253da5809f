// An object in an environment, and how it is turned. Drawing is as the stage's.
import type { Drawable } from "../light/compositor";
import { EnvironmentCompositor, type Environment } from "../light/environment";
import { Redraw } from "./redraw";
import type { Facing } from "./turning";

export class Scene {
  private readonly compositor: EnvironmentCompositor;
  private readonly redraw: Redraw;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    rays: Drawable,
    private now: Facing,
  ) {
    this.compositor = new EnvironmentCompositor(canvas, rays);
    this.redraw = new Redraw(canvas, Math.max(rays.width, rays.height), {
      isDone: () => this.compositor.isDone,
      draw: (step) => this.compositor.draw((this.now.turn_deg * Math.PI) / 180, this.now.gain, step),
    });
  }

  get mostPictureSide(): number {
    return this.compositor.mostPictureSide;
  }
  get facing(): Facing {
    return this.now;
  }
  set facing(facing: Facing) {
    this.now = facing;
    this.redraw.soon();
  }
  setEnvironment(picture: Environment): void {
    this.compositor.setEnvironment(picture);
    this.redraw.soon(true);
  }

  /** The canvas as a PNG, once everything requested is drawn. */
  picture(): Promise<Blob> {
    this.redraw.now();
    const copy = new OffscreenCanvas(this.canvas.width, this.canvas.height);
    copy.getContext("2d")!.drawImage(this.canvas, 0, 0);
    return copy.convertToBlob({ type: "image/png" });
  }
  close(): void {
    this.redraw.close();
    this.compositor.close();
  }
}
