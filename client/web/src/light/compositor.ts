// Composites a matte's object over pictures, on a canvas of the matte's size (docs/matte.md):
//
//   C = F + sum over modes of R * integral over the monitor of G(x; c, S) T(x) dx
//
// T is read from the pyramid level (pyramid.ts) that suits each footprint (footprints.ts). It is black beyond a monitor's edge.
import type { Footprints } from "./footprints";
import { NoWebGl, Program, makeTexture, openContext } from "./gl";
import type { Box, MatteMetadata } from "./matte";
import { primaryMix, type PrimaryMix } from "./primary_mix";
import { Pyramids, type Picture, type Placement } from "./pyramid";
import { kBorder, pyramidShape, type PyramidShape } from "./pyramid_shape";
import { composite, kEverything } from "./shaders";

/** The data of a matte that the compositor needs. */
export interface Drawable {
  metadata: MatteMetadata;
  width: number;
  height: number;
  foreground: Float32Array<ArrayBuffer>;
  footprints: Footprints;
  /** Pixels without a result. */
  unsolved: Uint32Array<ArrayBuffer>;
  /** The pixels that see a monitor's picture: not, for instance, the id patches below it. */
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
  private readonly gl: WebGL2RenderingContext;
  private readonly shapes: PyramidShape[];
  private readonly mix: PrimaryMix;
  private readonly pyramids: Pyramids;
  private readonly program: Program;
  private readonly foreground: WebGLTexture;
  private readonly index: WebGLTexture;
  private readonly list: WebGLTexture;
  private readonly pictures: (Picture | undefined)[] = [];
  private size = { width: 0, height: 0 };
  private drawn: WebGLSync | null = null;

  /** Drawing sets the canvas to the matte's size. NoWebGl names what the browser lacks. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    matte: Drawable,
  ) {
    const { metadata } = matte;
    if (metadata.monitors.length > kMaxMonitors)
      throw new NoWebGl(
        `the matte has ${metadata.monitors.length} monitors; the browser can show ${kMaxMonitors}`,
      );
    const gl = (this.gl = openContext(canvas));
    this.shapes = metadata.monitors.map(({ width_px, height_px }) => pyramidShape(width_px, height_px));
    this.mix = primaryMix(metadata);
    const largest = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    const needed = Math.max(
      matte.width,
      matte.height,
      matte.footprints.listWidth,
      ...this.shapes.flatMap(({ width, height }) => [width, height]),
    );
    if (needed > largest)
      throw new NoWebGl(`the matte needs textures of ${needed} px; this graphics processor has ${largest}`);
    this.pyramids = new Pyramids(gl, this.shapes);
    this.foreground = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    this.index = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    this.list = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    const levels = this.shapes.flatMap((shape) => shape.levels);
    this.program = new Program(
      gl,
      kEverything,
      composite(levels.length, this.shapes.length, metadata.footprint === "box"),
    ).use();
    gl.uniform4iv(
      this.program.at("u_levels"),
      levels.flatMap(({ x, y, width, height }) => [x, y, width, height]),
    );
    gl.uniform1iv(
      this.program.at("u_first_level"),
      this.shapes.map((_, t) =>
        this.shapes.slice(0, t).reduce((sum, { levels: own }) => sum + own.length, 0),
      ),
    );
    gl.uniform1i(this.program.at("u_border"), kBorder);
    gl.uniformMatrix3fv(this.program.at("u_primaries"), true, this.mix.primaries);
    this.setMatte(matte);
  }

  /** Loads another frame of the same video, with the same monitors and kind of footprint. */
  setMatte({ width, height, foreground, footprints }: Drawable): void {
    const { gl } = this;
    this.size = { width, height };
    const light = new Float32Array(4 * width * height);
    for (let i = 0; i < width * height; ++i) light.set(foreground.subarray(3 * i, 3 * i + 3), 4 * i);
    const load = (
      texture: WebGLTexture,
      inside: number,
      w: number,
      h: number,
      format: number,
      type: number,
      data: ArrayBufferView,
    ): void => {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, inside, w, h, 0, format, type, data);
    };
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    load(this.foreground, gl.RGBA32F, width, height, gl.RGBA, gl.FLOAT, light);
    load(this.index, gl.RG32UI, width, height, gl.RG_INTEGER, gl.UNSIGNED_INT, footprints.index);
    load(
      this.list,
      gl.RGBA32UI,
      footprints.listWidth,
      footprints.listHeight,
      gl.RGBA_INTEGER,
      gl.UNSIGNED_INT,
      footprints.list,
    );
  }

  /** Sets an sRGB picture for a monitor; null is black. */
  setPicture(monitor: number, image: ImageBitmap | null): void {
    const { gl } = this;
    const before = this.pictures[monitor];
    if (before) gl.deleteTexture(before.texture);
    this.pictures[monitor] = undefined;
    if (!image) return this.pyramids.clear(monitor);
    const texture = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
    this.pictures[monitor] = { texture, width: image.width, height: image.height };
  }

  place(monitor: number, standing: Standing): void {
    const picture = this.pictures[monitor];
    if (!picture) return;
    this.pyramids.fill(
      monitor,
      picture,
      placementOf(picture, this.shapes[monitor]!.levels[0]!, standing),
      this.mix.seen[monitor]!,
    );
  }

  /** `gain`: factor on the composite's light. `step`: every how many pixels along both sides one is drawn. */
  draw(gain: number, step: number): void {
    const { gl, canvas } = this;
    const [width, height] = [Math.ceil(this.size.width / step), Math.ceil(this.size.height / step)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const program = this.program.use();
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.uniform1i(program.at("u_step"), step);
    program.bind("u_index", 0, gl.TEXTURE_2D, this.index);
    program.bind("u_list", 1, gl.TEXTURE_2D, this.list);
    program.bind("u_foreground", 2, gl.TEXTURE_2D, this.foreground);
    program.bind("u_pyramid", 3, gl.TEXTURE_2D_ARRAY, this.pyramids.texture);
    gl.uniform1f(program.at("u_gain"), gain);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.activeTexture(gl.TEXTURE0);
    gl.deleteSync(this.drawn);
    this.drawn = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  /** True once everything requested is on the canvas. */
  get isDone(): boolean {
    return (
      this.drawn === null || this.gl.getSyncParameter(this.drawn, this.gl.SYNC_STATUS) === this.gl.SIGNALED
    );
  }

  /** The maximum side of a picture. */
  get mostPictureSide(): number {
    return this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE) as number;
  }

  close(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
