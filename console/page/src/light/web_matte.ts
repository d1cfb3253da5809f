// Reads the folder that `glasswing web` writes (core/web/web_matte.h, docs/web.md).
import { BundleList } from "./bundles";
import type { Drawable } from "./compositor";
import { FootprintList } from "./footprints";
import type { MatteMetadata, Mode } from "./matte";
import { lightOf } from "./srgb";

export interface WebDescription {
  format: "glasswing-web";
  version: number;
  title: string;
  /** Of the matte: the part that sees a monitor's picture. */
  x_px: number;
  y_px: number;
  width_px: number;
  height_px: number;
  metadata: MatteMetadata;
  unit_px: number;
  origin_px: number;
  foreground_scale: number;
  footprints: number;
  planes: { name: string; bytes: number }[];
  /** Of a matte. */
  backgrounds?: string[];
  /** Of rays, whose monitors are the faces of a cube. */
  environments?: string[];
  /** At first, about the vertical. */
  turn_deg?: number;
  /** Factor on the environment's light. */
  gain?: number;
  /** The angle that the camera sees across. */
  view_deg?: number;
}

const kVersion = 1;
const kMostFootprints = 255; // of a pixel
const kWidthsAnOctave = 16;
const kNarrowest_px = 1 / 16;
const kWeightUnit = 1 / 512;
const kAngles = 256;
const kMostPixels = 1 << 26;

export class NotAWebMatte extends Error {}

export function checkedDescription(read: unknown): WebDescription {
  const description = read as WebDescription;
  if (description?.format !== "glasswing-web")
    throw new NotAWebMatte("matte.json is not a matte that glasswing web wrote");
  if (description.version !== kVersion)
    throw new NotAWebMatte(`the folder has version ${description.version}; this player reads version ${kVersion}`);
  const { width_px, height_px } = description;
  if (!(width_px >= 1 && height_px >= 1 && width_px * height_px <= kMostPixels))
    throw new NotAWebMatte(`matte.json declares ${width_px}x${height_px}; there must be 1 to ${kMostPixels} pixels`);
  return description;
}

async function inflated(packed: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function planesOf(
  { planes }: WebDescription,
  bytes: Uint8Array<ArrayBuffer>,
): Promise<(name: string) => Uint8Array> {
  const unpacked = new Map<string, Uint8Array>();
  let at = 0;
  await Promise.all(
    planes.map(async ({ name, bytes: size }) => {
      const packed = bytes.subarray(at, (at += size));
      if (packed.length !== size) throw new NotAWebMatte("matte.bin ends too early");
      unpacked.set(name, await inflated(packed));
    }),
  );
  return (name) => {
    const plane = unpacked.get(name);
    if (!plane) throw new NotAWebMatte(`matte.json names no plane ${name}`);
    return plane;
  };
}

/** Undoes the folding of a difference of 16 bits. */
function unfolded(low: number, high: number): number {
  const folded = low | (high << 8);
  return (folded >>> 1) ^ -(folded & 1);
}

const kWidths = Float64Array.from({ length: 256 }, (_, code) => kNarrowest_px * 2 ** (code / kWidthsAnOctave));
const kTurns = Float64Array.from({ length: kAngles }, (_, code) => (code * Math.PI) / kAngles);
const [kCosines, kSines] = [kTurns.map(Math.cos), kTurns.map(Math.sin)];
const kLights = Float32Array.from({ length: 256 }, (_, code) => lightOf(code / 255));

export async function readWebMatte(description: WebDescription, bytes: Uint8Array<ArrayBuffer>): Promise<Drawable> {
  const { width_px: width, height_px: height, metadata, unit_px, origin_px, foreground_scale } = description;
  const plane = await planesOf(description, bytes);
  const [count, x_low, x_high, y_low, y_high, wide, narrow, angle, texture] = [
    plane("count"),
    plane("x_low"),
    plane("x_high"),
    plane("y_low"),
    plane("y_high"),
    plane("wide"),
    plane("narrow"),
    plane("angle"),
    plane("texture"),
  ] as const;
  const lights = ["red", "green", "blue"].map(plane);
  const weightPlanes = ["red", "green", "blue"].map((name) => [plane(`${name}_low`), plane(`${name}_high`)] as const);
  const pixels = width * height;
  if (count.length !== pixels || wide.length !== description.footprints)
    throw new NotAWebMatte("matte.bin and matte.json differ in their number of pixels");

  const foreground = new Float32Array(3 * pixels);
  const list = new (description.environments ? BundleList : FootprintList)(metadata, pixels, description.footprints);
  // What differences refer to: F of the pixel before, and by place in a pixel's list the footprint before.
  const light = [0, 0, 0];
  const last = new Int32Array(kMostFootprints * 8);
  // There are millions of footprints: none makes an object of its own.
  const take = (at: number, difference: number, mask: number): number =>
    (last[at] = (last[at]! + difference) & mask);
  const weights = [0, 0, 0];
  const mode: Mode = { weight: 0, x: 0, y: 0, xx: 0, xy: 0, yy: 0, texture: 0, weight_sd: 0, centre_sd: 0 };
  let next = 0;
  for (let pixel = 0; pixel < pixels; ++pixel) {
    for (let c = 0; c < 3; ++c) {
      light[c] = (light[c]! + lights[c]![pixel]!) & 255;
      foreground[3 * pixel + c] = foreground_scale * kLights[light[c]!]!;
    }
    list.nextPixel();
    for (let slot = 0; slot < count[pixel]!; ++slot, ++next) {
      if (texture[next]! >= metadata.monitors.length)
        throw new NotAWebMatte("matte.bin names a monitor that is not in matte.json");
      const at = 8 * slot;
      mode.x = origin_px + unit_px * take(at, unfolded(x_low[next]!, x_high[next]!), 0xffff);
      mode.y = origin_px + unit_px * take(at + 1, unfolded(y_low[next]!, y_high[next]!), 0xffff);
      const wide_px = kWidths[take(at + 2, wide[next]!, 255)]!;
      const narrow_px = kWidths[take(at + 3, narrow[next]!, 255)]!;
      const turn = take(at + 4, angle[next]!, 255);
      for (let c = 0; c < 3; ++c) {
        const [low, high] = weightPlanes[c]!;
        weights[c] = kWeightUnit * take(at + 5 + c, unfolded(low[next]!, high[next]!), 0xffff);
      }
      const [cos, sin] = [kCosines[turn]!, kSines[turn]!];
      const [w2, n2] = [wide_px * wide_px, narrow_px * narrow_px];
      mode.weight = Math.max(weights[0]!, weights[1]!, weights[2]!);
      mode.xx = w2 * cos * cos + n2 * sin * sin;
      mode.xy = (w2 - n2) * cos * sin;
      mode.yy = w2 * sin * sin + n2 * cos * cos;
      mode.texture = texture[next]!;
      list.add(mode, weights);
    }
  }
  return {
    metadata,
    width,
    height,
    foreground,
    footprints: list.packed(),
    unsolved: new Uint32Array(),
    seeing: { x: 0, y: 0, width, height },
  };
}
