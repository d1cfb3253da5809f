// Composites a matte's object over pictures, on a canvas of the matte's size (docs/matte.md):
//
//   C = F + sum over modes of R * integral over the monitor of G(x; c, S) T(x) dx
//
// T is read from the pyramid level (pyramid.ts) that suits each footprint (footprints.ts). It is black beyond a monitor's edge.
import type { Footprints } from "./footprints";
import { NoWebGl, Program, makeTexture } from "./gl";
import type { Box, MatteMetadata } from "./matte";
import { kUnit, primaryMix, type PrimaryMix } from "./primary_mix";
import { Pyramids, srgbPicture, type Picture, type Placement } from "./pyramid";
import { kBorder, pyramidShape, type PyramidShape } from "./pyramid_shape";
import { composite, kEverything, movingComposite, sketch } from "./shaders";
import { Surface, kFreeUnit } from "./surface";

/** The data of a matte that the compositor needs. */
export interface Drawable {
  metadata: MatteMetadata;
  width: number;
  height: number;
  foreground: Float32Array<ArrayBuffer>;
  footprints: Footprints;
  /** Pixels without a result. */
  unsolved: Uint32Array<ArrayBuffer>;
  /** The pixels that see a monitor's picture: the id patches below it, for instance, are excluded. */
  seeing: Box;
}

/** The placement of a picture on its monitor: stretched, or in its own aspect ratio and cropped. */
export interface Standing {
  keepShape: boolean;
  /** Shift in monitor px, right and down. */
  dx: number;
  dy: number;
  /** Scale; 1 fills the monitor. */
  scale: number;
}

export function placementOf(
  picture: { width: number; height: number },
  monitor: { width: number; height: number },
  standing: Standing,
): Placement {
  const stretch = { x: picture.width / monitor.width, y: picture.height / monitor.height };
  const shared = Math.min(stretch.x, stretch.y);
  const stepX = (standing.keepShape ? shared : stretch.x) / standing.scale;
  const stepY = (standing.keepShape ? shared : stretch.y) / standing.scale;
  return {
    x: 0.5 * picture.width - (0.5 * monitor.width + standing.dx) * stepX,
    y: 0.5 * picture.height - (0.5 * monitor.height + standing.dy) * stepY,
    stepX,
    stepY,
  };
}

const kMaxMonitors = 8;

export class Compositor {
  private readonly surface: Surface;
  private readonly shapes: PyramidShape[];
  private readonly mix: PrimaryMix;
  private readonly pyramids: Pyramids;
  /** Of whole pictures, stretched to their monitors, for drawing while they move. */
  private readonly whole: Pyramids;
  /** By monitor, as the shaders read them: where its whole picture stands while it moves, and at what scale. */
  private readonly places: Float32Array;
  private readonly scales: Float32Array;
  private readonly unplaced = new Map<number, Placement>();
  private readonly program: Program;
  private readonly movingProgram: Program;
  private readonly sketchProgram: Program;
  private readonly frame: WebGLFramebuffer;
  private sketches: { texture: WebGLTexture; width: number; height: number } | undefined;
  private sketched = false;
  private readonly pictures: (Picture | undefined)[] = [];

  /** Drawing sets the canvas to the size of the matte, or of `view`. NoWebGl names what the browser lacks. */
  constructor(canvas: HTMLCanvasElement, matte: Drawable) {
    const { metadata } = matte;
    if (metadata.monitors.length > kMaxMonitors)
      throw new NoWebGl(
        `the matte has ${metadata.monitors.length} monitors; the browser can show ${kMaxMonitors}`,
      );
    this.surface = new Surface(canvas);
    const { gl } = this.surface;
    this.shapes = metadata.monitors.map(({ width_px, height_px }) => pyramidShape(width_px, height_px));
    this.mix = primaryMix(metadata);
    this.surface.checkSizes(
      matte,
      this.shapes.flatMap(({ width, height }) => [width, height]),
    );
    this.pyramids = new Pyramids(gl, this.shapes);
    this.whole = new Pyramids(gl, this.shapes, true);
    this.places = new Float32Array(4 * this.shapes.length);
    this.scales = new Float32Array(2 * this.shapes.length);
    this.frame = gl.createFramebuffer();
    const [levels, monitors] = [this.shapes.flatMap((shape) => shape.levels), this.shapes.length];
    const make = (shader: string): Program => {
      const program = new Program(gl, kEverything, shader).use();
      const areas = levels.flatMap(({ x, y, width, height }) => [x, y, width, height]);
      gl.uniform4iv(program.at("u_levels"), areas);
      gl.uniform4fv(program.at("u_areas"), areas);
      gl.uniform1iv(
        program.at("u_first_level"),
        this.shapes.map((_, t) => this.shapes.slice(0, t).reduce((sum, { levels: own }) => sum + own.length, 0)),
      );
      gl.uniform1iv(
        program.at("u_last_level"),
        this.shapes.map(({ levels: own }) => own.length - 1),
      );
      gl.uniform1i(program.at("u_border"), kBorder);
      gl.uniformMatrix3fv(program.at("u_primaries"), true, this.mix.primaries);
      return program;
    };
    this.program = make(composite(levels.length, monitors, metadata.footprint === "box"));
    this.sketchProgram = make(sketch(levels.length, monitors));
    this.movingProgram = make(movingComposite(levels.length, monitors));
    gl.uniformMatrix3fv(this.movingProgram.at("u_seen"), true, this.mix.seen.flat());
    gl.uniform2f(this.movingProgram.at("u_texel"), 1 / this.whole.width, 1 / this.whole.height);
    this.setMatte(matte);
  }

  /** Loads another frame of the same video, with the same monitors and kind of footprint. */
  setMatte(matte: Drawable): void {
    const { gl } = this.surface;
    this.surface.setMatte(matte);
    const { listWidth, listHeight: height } = matte.footprints;
    if (this.sketches) gl.deleteTexture(this.sketches.texture);
    this.sketches = { texture: makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST), width: listWidth / 2, height };
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, listWidth / 2, height);
    this.sketched = false;
  }

  /** Draws only this part of the matte; undefined: all of it. */
  set view(part: Box | undefined) {
    this.surface.view = part;
  }

  /** Sets an sRGB picture for a monitor; null is black. */
  setPicture(monitor: number, image: ImageBitmap | null): void {
    const { gl } = this.surface;
    const before = this.pictures[monitor];
    if (before) gl.deleteTexture(before.texture);
    this.pictures[monitor] = undefined;
    this.unplaced.delete(monitor);
    if (!image) {
      this.whole.clear(monitor);
      return this.pyramids.clear(monitor);
    }
    const picture = (this.pictures[monitor] = srgbPicture(gl, image));
    const { width, height } = this.shapes[monitor]!.levels[0]!;
    const stretched = { x: 0, y: 0, stepX: picture.width / width, stepY: picture.height / height };
    this.whole.fill(monitor, picture, stretched, kUnit);
  }

  place(monitor: number, standing: Standing): void {
    const picture = this.pictures[monitor];
    if (!picture) return;
    const shape = this.shapes[monitor]!.levels[0]!;
    const place = placementOf(picture, shape, standing);
    const [acrossX, acrossY] = [shape.width / picture.width, shape.height / picture.height];
    const [scaleX, scaleY] = [acrossX * place.stepX, acrossY * place.stepY];
    if (this.scales[2 * monitor] !== Math.fround(scaleX) || this.scales[2 * monitor + 1] !== Math.fround(scaleY)) {
      this.scales.set([scaleX, scaleY], 2 * monitor);
      this.sketched = false;
    }
    // Sketches count from half a monitor before its corner to half a monitor beyond the other.
    const [across, down] = [2 * shape.width * scaleX, 2 * shape.height * scaleY];
    this.places.set([acrossX * place.x - across / 4, acrossY * place.y - down / 4, across, down], 4 * monitor);
    this.unplaced.set(monitor, place);
  }

  /**
   * `gain`: factor on the composite's light. `step`: one of this many pixels is drawn along both sides. `moving`: each
   * footprint is approximated by a few look-ups.
   */
  draw(gain: number, step: number, moving = false): void {
    const { gl } = this.surface;
    if (moving) this.sketch();
    else {
      for (const [monitor, place] of this.unplaced)
        this.pyramids.fill(monitor, this.pictures[monitor]!, place, this.mix.seen[monitor]!);
      this.unplaced.clear();
    }
    const program = (moving ? this.movingProgram : this.program).use();
    const { texture } = moving ? this.whole : this.pyramids;
    program.bind("u_pyramid", kFreeUnit, gl.TEXTURE_2D_ARRAY, texture);
    if (moving) {
      const { texture: sketches, width } = this.sketches!;
      program.bind("u_sketch", 1, gl.TEXTURE_2D, sketches);
      gl.uniform1i(program.at("u_sketch_bits"), Math.log2(width));
      gl.uniform4fv(program.at("u_place"), this.places);
    } else {
      this.surface.bindList(program, 1);
    }
    gl.uniform1f(program.at("u_gain"), gain);
    this.surface.draw(program, step);
  }

  /** Recomputes the footprints' sketches if the matte or a picture's scale has changed. */
  private sketch(): void {
    if (this.sketched) return;
    const { gl } = this.surface;
    const { texture, width, height } = this.sketches!;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.viewport(0, 0, width, height);
    const program = this.sketchProgram.use();
    this.surface.bindList(program, 1);
    gl.uniform2fv(program.at("u_scale"), this.scales);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.sketched = true;
  }

  /** True once everything requested is on the canvas. */
  get isDone(): boolean {
    return this.surface.isDone;
  }

  /** The maximum side of a picture. */
  get mostPictureSide(): number {
    return this.surface.mostPictureSide;
  }

  close(): void {
    this.surface.close();
  }
}
