// The background pictures as pyramids, in one texture with a layer for each monitor.
import { Program, makeTexture } from "./gl";
import { kUnit, type Matrix } from "./primary_mix";
import { kBorder, type Level, type PyramidShape } from "./pyramid_shape";
import { kEverything, kHalveAcross, kHalveDown, kResize } from "./shaders";

/** The part of a picture that a monitor shows: the picture's px at the monitor's corner, and per monitor px. */
export interface Placement {
  x: number;
  y: number;
  stepX: number;
  stepY: number;
}

/** A texture and its size. */
export interface Picture {
  texture: WebGLTexture;
  width: number;
  height: number;
}

/** Reads as linear light. */
export function srgbPicture(gl: WebGL2RenderingContext, image: ImageBitmap): Picture {
  const texture = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
  return { texture, width: image.width, height: image.height };
}

export class Pyramids {
  readonly texture: WebGLTexture;
  readonly width: number;
  readonly height: number;
  private readonly resize: Program;
  private readonly halveAcross: Program;
  private readonly halveDown: Program;
  private readonly frame: WebGLFramebuffer;
  private readonly scratch: Picture;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    private readonly shapes: PyramidShape[],
    /** Beyond its edges a picture is continued by its edge pixels, and the texture has roots of light in bytes, which
     * software reads fast; else it is black there. */
    private readonly whole = false,
  ) {
    this.resize = new Program(gl, kEverything, kResize);
    this.halveAcross = new Program(gl, kEverything, kHalveAcross);
    this.halveDown = new Program(gl, kEverything, kHalveDown);
    this.frame = gl.createFramebuffer();
    this.scratch = { texture: makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST), width: 0, height: 0 };
    const width = (this.width = Math.max(...shapes.map((shape) => shape.width)));
    const height = (this.height = Math.max(...shapes.map((shape) => shape.height)));
    this.texture = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, whole ? gl.RGBA8 : gl.RGBA16F, width, height, shapes.length);
    for (let layer = 0; layer < shapes.length; ++layer) this.clear(layer);
  }

  /** A monitor without a picture is black. */
  clear(layer: number): void {
    const { gl } = this;
    this.drawOn(layer);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /** `picture`: a texture that reads as linear light. `seen`: converts it to the camera's channels. */
  fill(layer: number, picture: Picture, place: Placement, seen: Matrix): void {
    this.drawOnScratch(this.shapes[layer]!.levels[0]!.width, picture.height);
    this.drawResized(picture.texture, {
      down: false,
      size: picture.width,
      start: place.x,
      step: place.stepX,
      seen: kUnit,
      root: false,
    });
    this.draw(layer, (corner) =>
      this.drawResized(this.scratch.texture, {
        down: true,
        size: picture.height,
        start: place.y,
        step: place.stepY,
        seen,
        root: this.whole,
        corner,
      }),
    );
  }

  /** `paint` draws the first level where it stands; the others are made of it. */
  draw(layer: number, paint: (first: Level) => void): void {
    const { gl } = this;
    const [first, ...others] = this.shapes[layer]!.levels as [Level, ...Level[]];
    this.drawOn(layer);
    gl.viewport(first.x, first.y, first.width, first.height);
    paint(first);
    let above = first;
    for (const level of others) {
      this.halve(layer, above, level);
      above = level;
    }
  }

  close(): void {
    const { gl } = this;
    for (const program of [this.resize, this.halveAcross, this.halveDown]) program.close();
    for (const texture of [this.texture, this.scratch.texture]) gl.deleteTexture(texture);
    gl.deleteFramebuffer(this.frame);
  }

  private drawResized(
    from: WebGLTexture,
    how: { down: boolean; size: number; start: number; step: number; seen: Matrix; root: boolean; corner?: Level },
  ): void {
    const { gl } = this;
    const program = this.resize.use();
    program.bind("u_picture", 0, gl.TEXTURE_2D, from);
    gl.uniform1i(program.at("u_down"), how.down ? 1 : 0);
    gl.uniform1i(program.at("u_size"), how.size);
    gl.uniform1f(program.at("u_start"), how.start);
    gl.uniform1f(program.at("u_step"), how.step);
    gl.uniform2i(program.at("u_corner"), how.corner?.x ?? 0, how.corner?.y ?? 0);
    gl.uniformMatrix3fv(program.at("u_seen"), true, how.seen);
    gl.uniform1i(program.at("u_whole"), how.root ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  private halve(layer: number, above: Level, level: Level): void {
    const { gl } = this;
    const width = level.width + 2 * kBorder;
    this.drawOnScratch(width, above.height + 2 * kBorder);
    const across = this.halveAcross.use();
    across.bind("u_pyramid", 0, gl.TEXTURE_2D_ARRAY, this.texture);
    gl.uniform1i(across.at("u_layer"), layer);
    gl.uniform1i(across.at("u_whole"), this.whole ? 1 : 0);
    gl.uniform1i(across.at("u_border"), kBorder);
    gl.uniform4i(across.at("u_above"), above.x, above.y, above.width, above.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.drawOn(layer);
    gl.viewport(level.x - kBorder, level.y - kBorder, width, level.height + 2 * kBorder);
    const down = this.halveDown.use();
    down.bind("u_across", 0, gl.TEXTURE_2D, this.scratch.texture);
    gl.uniform1i(down.at("u_border"), kBorder);
    gl.uniform1i(down.at("u_whole"), this.whole ? 1 : 0);
    gl.uniform1i(down.at("u_height"), above.height);
    gl.uniform2i(down.at("u_corner"), level.x - kBorder, level.y - kBorder);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  private drawOn(layer: number): void {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.texture, 0, layer);
  }

  /** A texture of at least width x height texels; it only grows. */
  private drawOnScratch(width: number, height: number): void {
    const { gl, scratch } = this;
    if (width > scratch.width || height > scratch.height) {
      scratch.width = Math.max(width, scratch.width);
      scratch.height = Math.max(height, scratch.height);
      gl.bindTexture(gl.TEXTURE_2D, scratch.texture);
      gl.texImage2D(
        gl.TEXTURE_2D,
        0,
        gl.RGBA16F,
        scratch.width,
        scratch.height,
        0,
        gl.RGBA,
        gl.HALF_FLOAT,
        null,
      );
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, scratch.texture, 0);
    gl.viewport(0, 0, width, height);
  }
}
