// The canvas, its context, and a matte's pixels as the textures that both compositors' shaders read.
import type { Footprints } from "./footprints";
import { NoWebGl, Program, makeTexture, openContext } from "./gl";
import { toHalf } from "./half";
import type { Box } from "./matte";

export interface Pixels {
  width: number;
  height: number;
  foreground: Float32Array<ArrayBuffer>;
  footprints: Footprints;
}

/** The first texture unit that is free for others. */
export const kFreeUnit = 2;

const signedHalf = (value: number): number => (value < 0 ? 0x8000 | toHalf(-value) : toHalf(value));

export class Surface {
  readonly gl: WebGL2RenderingContext;
  /** Of a pixel: its first footprint; blue's F, and the number of footprints above it; red's and green's F. */
  private readonly pixels: WebGLTexture;
  private readonly list: WebGLTexture;
  private listWidth = 1;
  private whole: Box = { x: 0, y: 0, width: 0, height: 0 };
  /** The part of the matte that is drawn; undefined: all of it. */
  view: Box | undefined;
  private drawn: WebGLSync | null = null;

  /** Drawing sets the canvas to the size of the matte, or of `view`. NoWebGl names what the browser lacks. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    const gl = (this.gl = openContext(canvas));
    this.pixels = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
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
    this.whole = { x: 0, y: 0, width, height };
    this.listWidth = footprints.listWidth;
    const words = new Uint32Array(4 * width * height);
    for (let i = 0; i < width * height; ++i) {
      const [red, green, blue] = [foreground[3 * i]!, foreground[3 * i + 1]!, foreground[3 * i + 2]!];
      words[4 * i] = footprints.index[2 * i]!;
      words[4 * i + 1] = signedHalf(blue) | (footprints.index[2 * i + 1]! << 16);
      words[4 * i + 2] = signedHalf(red) | (signedHalf(green) << 16);
    }
    this.load(this.pixels, width, height, words);
    this.load(this.list, footprints.listWidth, footprints.listHeight, footprints.list);
  }

  /** For shaders that read footprints by their eight words. */
  bindList(program: Program, unit: number): void {
    program.bind("u_list", unit, this.gl.TEXTURE_2D, this.list);
    this.gl.uniform1i(program.at("u_list_bits"), Math.log2(this.listWidth));
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
    program.bind("u_pixels", 0, gl.TEXTURE_2D, this.pixels);
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

  private load(texture: WebGLTexture, width: number, height: number, words: Uint32Array<ArrayBuffer>): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32UI, width, height, 0, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
  }

  close(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
