// A matte's modes as the compositor's shader reads them. Each uses the level of its monitor's pyramid that suits its
// smallest width. There the samples count as flat squares, over which G is integrated. That is right if G has
//
//   Q = (S + I/2) / 4^l - I/2        (samples of level l)
//
// instead of its covariance S: the blur of level l (its filter, and squares of 4^l / 12 px^2) less that of the pixels' own
// squares is subtracted. On the picture itself, l = 0, Q is S. This holds for boxes and Gaussians.
import { toHalf } from "./half";
import { kLayers, modesOf, type MatteData, type MatteMetadata, type Mode } from "./matte";
import { pyramidShape, type PyramidShape } from "./pyramid_shape";

/** Texels of four 32-bit words; a footprint has two. Every graphics processor has textures as wide as this. */
const kMinListWidth = 2048;

export interface Footprints {
  /** Two words per pixel: the index of its first footprint, and their number. */
  index: Uint32Array<ArrayBuffer>;
  /** Eight words a footprint. */
  list: Uint32Array<ArrayBuffer>;
  /** Of the list as a texture, a power of two, and no less than listHeight. */
  listWidth: number;
  listHeight: number;
}

export interface Place {
  level: number;
  x: number;
  y: number;
  xx: number;
  xy: number;
  yy: number;
}

// The minimum variance of a cut along x or y through Q. Samples of a Gaussian of variance v sum to 1 within
// 2 exp(-2 pi^2 v): 0.0008 if squares and this make 0.4. A box is six samples wide.
const kMinVariance = { gaussian: 0.32, box: 3 };
// Reach of a footprint in standard deviations.
const kReach = { gaussian: 3, box: Math.sqrt(3) };
// Limit of texture look-ups, of two samples each. A footprint that needs more uses a higher level, where it is widened to
// what that level can represent.
const kMaxLookUps = 256;

export function placeOf(mode: Mode, shape: PyramidShape, kind: keyof typeof kMinVariance): Place {
  const least = kMinVariance[kind];
  const on = (level: number): Place => {
    const scale = 0.5 ** level;
    const variance = (v: number): number => v * scale * scale + 0.5 * (scale * scale - 1);
    return {
      level,
      x: mode.x * scale,
      y: mode.y * scale,
      xx: variance(mode.xx),
      xy: mode.xy * scale * scale,
      yy: variance(mode.yy),
    };
  };
  const suits = ({ xx, xy, yy }: Place): boolean =>
    xx > 0 && yy > 0 && xx * yy - xy * xy >= least * Math.max(xx, yy);
  const last = shape.levels.length - 1;
  let place = on(0);
  while (place.level < last && suits(on(place.level + 1))) place = on(place.level + 1);
  while (place.level < last && lookUps(place, shape, kReach[kind]) > kMaxLookUps)
    place = widened(on(place.level + 1), least);
  return place;
}

/** The number of rows along the wider axis, and of samples in a cut through Q. */
function lookUps({ level, xx, xy, yy }: Place, shape: PyramidShape, reach: number): number {
  const { width, height } = shape.levels[level]!;
  const wide = Math.max(xx, yy, 1e-9);
  const cut = Math.max(Math.min(xx, yy) - (xy * xy) / wide, 0);
  const rows = Math.min(2 * reach * Math.sqrt(wide) + 1, xx > yy ? width : height);
  const samples = Math.min(2 * reach * Math.sqrt(cut) + 1 + Math.abs(xy) / wide, xx > yy ? height : width);
  return rows * Math.ceil(samples / 2);
}

/** Widens Q so that no axis of its ellipse is below `least`. */
function widened(place: Place, least: number): Place {
  const mean = 0.5 * (place.xx + place.yy);
  const half = 0.5 * (place.xx - place.yy);
  const away = Math.hypot(half, place.xy);
  if (mean - away >= least) return place;
  const wide = Math.max(mean + away, least);
  const share = away > 0 ? (0.5 * (wide - least)) / away : 0;
  const middle = 0.5 * (wide + least);
  return { ...place, xx: middle + share * half, yy: middle - share * half, xy: place.xy * share };
}

/** Merges modes of several channels with the same footprint into one with a weight per channel. */
function sharedModes(matte: MatteData, pixel: number): { mode: Mode; weights: number[] }[] {
  const shared: { mode: Mode; weights: number[] }[] = [];
  for (let channel = 0; channel < 3; ++channel) {
    for (const mode of modesOf(matte, pixel, channel)) {
      const same = shared.find(
        ({ mode: other, weights }) =>
          weights[channel] === 0 &&
          other.x === mode.x &&
          other.y === mode.y &&
          other.xx === mode.xx &&
          other.xy === mode.xy &&
          other.yy === mode.yy &&
          other.texture === mode.texture,
      );
      const entry = same ?? { mode, weights: [0, 0, 0] };
      entry.weights[channel] = mode.weight;
      if (!same) shared.push(entry);
    }
  }
  return shared;
}

/** Collects footprints, pixel by pixel, each of eight words with its weights in the sixth and seventh. */
export abstract class FootprintWords {
  private readonly index: Uint32Array<ArrayBuffer>;
  private readonly list: Uint32Array<ArrayBuffer>;
  private readonly floats: Float32Array<ArrayBuffer>;
  private pixel = -1;
  private count = 0;

  /** `most`: there are no more footprints than this. */
  constructor(pixels: number, most: number) {
    this.index = new Uint32Array(2 * pixels);
    this.list = new Uint32Array(8 * most);
    this.floats = new Float32Array(this.list.buffer);
  }

  nextPixel(): void {
    ++this.pixel;
    this.index[2 * this.pixel] = this.count;
  }

  /** Of the pixel; `weights` of its channels, in place of the mode's. */
  abstract add(mode: Mode, weights: readonly number[]): void;

  /** `before` the weights five numbers, after them one; `high`: 16 bits beside blue's weight. */
  protected put(before: readonly number[], weights: readonly number[], high: number, after: number): void {
    const at = 8 * this.count++;
    ++this.index[2 * this.pixel + 1]!;
    for (let i = 0; i < before.length; ++i) this.floats[at + i] = before[i]!;
    this.list[at + 5] = toHalf(weights[0]!) | (toHalf(weights[1]!) << 16);
    this.list[at + 6] = toHalf(weights[2]!) | (high << 16);
    this.floats[at + 7] = after;
  }

  packed(): Footprints {
    let listWidth = kMinListWidth;
    while (2 * this.count > listWidth * listWidth) listWidth *= 2;
    const listHeight = Math.max(1, Math.ceil((2 * this.count) / listWidth));
    const texels = new Uint32Array(4 * listWidth * listHeight);
    texels.set(this.list.subarray(0, 8 * this.count));
    return { index: this.index, list: texels, listWidth, listHeight };
  }
}

/** x, y, Q.xx, Q.yy, Q.xy, the weights with texture and level beside them, the largest weight. */
export class FootprintList extends FootprintWords {
  private readonly shapes: PyramidShape[];
  private readonly kind: keyof typeof kMinVariance;

  constructor({ monitors, footprint }: MatteMetadata, pixels: number, most: number) {
    super(pixels, most);
    this.kind = footprint === "box" ? "box" : "gaussian";
    this.shapes = monitors.map(({ width_px, height_px }) => pyramidShape(width_px, height_px));
  }

  override add(mode: Mode, weights: readonly number[]): void {
    const place = placeOf(mode, this.shapes[mode.texture]!, this.kind);
    this.put(
      [place.x, place.y, place.xx, place.yy, place.xy],
      weights,
      mode.texture | (place.level << 8),
      Math.max(weights[0]!, weights[1]!, weights[2]!),
    );
  }
}

export function packFootprints(matte: MatteData): Footprints {
  const pixels = matte.width * matte.height;
  const list = new FootprintList(matte.metadata, pixels, matte.modes.length / kLayers.length);
  for (let pixel = 0; pixel < pixels; ++pixel) {
    list.nextPixel();
    for (const { mode, weights } of sharedModes(matte, pixel)) list.add(mode, weights);
  }
  return list.packed();
}
