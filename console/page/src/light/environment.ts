// Composites bundles of directions in an environment, light from all directions (docs/rays.md, "Composites"), as
// core/rays/surroundings.h does: narrow bundles are footprints on the six faces of a cube, with a pyramid each; wide ones read
// small maps of light that is blurred already.
import { Program, makeTexture } from "./gl";
import type { Drawable } from "./compositor";
import { kBlurFaces, kBlurTwice, kFace, kHalfSide, kLight, kMean, surrounded } from "./environment_shaders";
import type { Hdr } from "./hdr";
import { primaryMix, type Matrix, type PrimaryMix } from "./primary_mix";
import { Pyramids, srgbPicture } from "./pyramid";
import { kBorder, pyramidShape, type PyramidShape } from "./pyramid_shape";
import { kEverything } from "./shaders";
import { Surface, kFreeUnit } from "./surface";

/** Equirectangular: an sRGB picture, or one in Radiance's format. */
export type Environment = ImageBitmap | Hdr;

const kFaces = 6;
const kWideCount = 7; // of 1 to 32 degrees, and all of the sphere
const kWide = { width: 256, height: 128 };
const kFirstWidth = Math.PI / 180; // rad, of the first map's bundles; they must be narrow on the faces
const kMaxDoubled_px = 1024; // faces of smaller pictures have two pixels for one ahead
const kMinSide_px = 16;

function faceShape(width_px: number, largest: number): PyramidShape {
  const ahead = (2 * kHalfSide * width_px) / (2 * Math.PI);
  const side = Math.max(kMinSide_px, Math.ceil(width_px <= kMaxDoubled_px ? 2 * ahead : ahead));
  const shape = pyramidShape(side, side);
  if (shape.width <= largest) return shape;
  const less = Math.floor((side * largest) / shape.width) - 8;
  return pyramidShape(less, less);
}

/** A picture's faces and maps. */
class EnvironmentMap {
  readonly wide: WebGLTexture;
  private readonly faces: Pyramids;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    picture: Environment,
    seen: Matrix,
    private readonly shape: PyramidShape,
  ) {
    this.faces = new Pyramids(
      gl,
      Array.from({ length: kFaces }, () => shape),
    );
    this.drawFaces(picture, seen);
    this.wide = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_WRAP_S, gl.REPEAT);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA16F, kWide.width, kWide.height, kWideCount);
    this.blur();
  }

  /** For shaders that call narrow(). */
  bindFaces(program: Program): void {
    const { gl } = this;
    program.bind("u_pyramid", kFreeUnit, gl.TEXTURE_2D_ARRAY, this.faces.texture);
    gl.uniform4iv(
      program.at("u_levels"),
      this.shape.levels.flatMap(({ x, y, width, height }) => [x, y, width, height]),
    );
    gl.uniform1i(program.at("u_level_count"), this.shape.levels.length);
    gl.uniform1i(program.at("u_border"), kBorder);
  }

  close(): void {
    this.faces.close();
    this.gl.deleteTexture(this.wide);
  }

  private drawFaces(picture: Environment, seen: Matrix): void {
    const { gl } = this;
    const light = this.lightOf(picture, seen);
    const program = new Program(gl, kEverything, kFace);
    for (let face = 0; face < kFaces; ++face)
      this.faces.draw(face, ({ x, y, width }) => {
        program.use().bind("u_picture", 0, gl.TEXTURE_2D, light);
        gl.uniform1i(program.at("u_face"), face);
        gl.uniform1i(program.at("u_side"), width);
        gl.uniform2i(program.at("u_corner"), x, y);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
      });
    program.close();
    gl.deleteTexture(light);
  }

  private lightOf(picture: Environment, seen: Matrix): WebGLTexture {
    const { gl } = this;
    const { width, height } = picture;
    const isSrgb = picture instanceof ImageBitmap;
    const codes = isSrgb ? srgbPicture(gl, picture).texture : makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    if (!isSrgb) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, picture.codes);
    const light = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA16F, width, height);
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, light, 0);
    gl.viewport(0, 0, width, height);
    const program = new Program(gl, kEverything, kLight).use();
    program.bind("u_picture", 0, gl.TEXTURE_2D, codes);
    gl.uniform1i(program.at("u_exponent"), isSrgb ? 0 : 1);
    gl.uniformMatrix3fv(program.at("u_seen"), true, seen);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    program.close();
    gl.deleteTexture(codes);
    gl.deleteFramebuffer(frame);
    return light;
  }

  private blur(): void {
    const { gl } = this;
    const { width, height } = kWide;
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, width, height);
    // A shader cannot read the texture that it draws on, so this is the previous map.
    const before = makeTexture(gl, gl.TEXTURE_2D, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.REPEAT);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA16F, width, height);
    const draw = (layer: number): void => {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.wide, 0, layer);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, before);
      gl.copyTexSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 0, 0, width, height);
    };
    const first = new Program(gl, kEverything, kBlurFaces).use();
    this.bindFaces(first);
    gl.uniform2f(first.at("u_size"), width, height);
    // Less what interpolation between the map's pixels adds.
    gl.uniform1f(first.at("u_variance"), kFirstWidth ** 2 - (Math.PI / height) ** 2 / 6);
    draw(0);
    const twice = new Program(gl, kEverything, kBlurTwice).use();
    for (let layer = 1; layer < kWideCount - 1; ++layer) {
      twice.bind("u_map", 0, gl.TEXTURE_2D, before);
      gl.uniform1f(twice.at("u_width"), kFirstWidth * 2 ** (layer - 1));
      draw(layer);
    }
    const mean = new Program(gl, kEverything, kMean).use();
    mean.bind("u_map", 0, gl.TEXTURE_2D, before);
    draw(kWideCount - 1);
    for (const program of [first, twice, mean]) program.close();
    gl.deleteTexture(before);
    gl.deleteFramebuffer(frame);
  }
}

export class EnvironmentCompositor {
  private readonly surface: Surface;
  private readonly mix: PrimaryMix;
  private readonly program: Program;
  private map: EnvironmentMap | undefined;

  /** `rays`: with bundles (bundles.ts) for footprints. Drawing sets the canvas to their size. */
  constructor(canvas: HTMLCanvasElement, rays: Drawable) {
    this.surface = new Surface(canvas);
    this.surface.checkSizes(rays, []);
    this.surface.setMatte(rays);
    this.mix = primaryMix(rays.metadata);
    this.program = new Program(this.surface.gl, kEverything, surrounded(kWideCount));
  }

  setEnvironment(picture: Environment): void {
    this.map?.close();
    const shape = faceShape(picture.width, this.mostPictureSide);
    this.map = new EnvironmentMap(this.surface.gl, picture, this.mix.seen[0]!, shape);
  }

  /** `turn`: of the environment about the vertical, rad: what lay ahead moves to the right. `gain`: factor on its light. */
  draw(turn: number, gain: number, step: number): void {
    if (!this.map) return;
    const { gl } = this.surface;
    const program = this.program.use();
    this.map.bindFaces(program);
    this.surface.bindList(program, 1);
    program.bind("u_wide", kFreeUnit + 1, gl.TEXTURE_2D_ARRAY, this.map.wide);
    gl.uniform1f(program.at("u_first_width"), kFirstWidth);
    gl.uniform2f(program.at("u_turn"), Math.cos(turn), Math.sin(turn));
    gl.uniformMatrix3fv(program.at("u_primaries"), true, this.mix.primaries);
    gl.uniform1f(program.at("u_light"), gain);
    gl.uniform1f(program.at("u_gain"), 1);
    this.surface.draw(program, step);
  }

  get isDone(): boolean {
    return this.surface.isDone;
  }

  get mostPictureSide(): number {
    return this.surface.mostPictureSide;
  }

  close(): void {
    this.surface.close();
  }
}
