// The canvas, its context, and a matte's pixels as the textures that both compositors' shaders read.
import type { Footprints } from "./footprints";
import { NoWebGl, Program, makeTexture, openContext } from "./gl";
import type { Box } from "./matte";

export interface Pixels {
  width: number;
  height: number;
  foreground: Float32Array<ArrayBuffer>;
  footprints: Footprints;
}

/** The first texture unit that is free for others. */
export const kFreeUnit = 3;

export class Surface {
  readonly gl: WebGL2RenderingContext;
  private readonly foreground: WebGLTexture;
  private readonly index: WebGLTexture;
  private readonly list: WebGLTexture;
  private whole: Box = { x: 0, y: 0, width: 0, height: 0 };
  /** The part of the matte that is drawn; undefined: all of it. */
  view: Box | undefined;
  private drawn: WebGLSync | null = null;

  /** Drawing sets the canvas to the size of the matte, or of `view`. NoWebGl names what the browser lacks. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    const gl = (this.gl = openContext(canvas));
    this.foreground = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    this.index = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    this.list = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
  }

  /** `sides`: of other textures that the matte needs. */
  checkSizes({ width, height, footprints }: Pixels, sides: number[]): void {
    const needed = Math.max(width, height, footprints.listWidth, ...sides);
    if (needed > this.mostPictureSide)
      throw new NoWebGl(
        `the matte needs textures of ${needed} px; this graphics processor has ${this.mostPictureSide}`,
      );
  }

  setMatte({ width, height, foreground, footprints }: Pixels): void {
    const { gl } = this;
    this.whole = { x: 0, y: 0, width, height };
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

  /** `program`: in use, with all else that it needs. `step`: every how many pixels along both sides one is drawn. */
  draw(program: Program, step: number): void {
    const { gl, canvas } = this;
    const part = this.view ?? this.whole;
    const [width, height] = [Math.ceil(part.width / step), Math.ceil(part.height / step)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.uniform1i(program.at("u_step"), step);
    gl.uniform4i(program.at("u_view"), part.x, part.y, part.width, part.height);
    program.bind("u_index", 0, gl.TEXTURE_2D, this.index);
    program.bind("u_list", 1, gl.TEXTURE_2D, this.list);
    program.bind("u_foreground", 2, gl.TEXTURE_2D, this.foreground);
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
