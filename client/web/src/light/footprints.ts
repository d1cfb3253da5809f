// A matte's modes as the compositor's shader reads them. Each uses the level of its monitor's pyramid that suits its
// smallest width. There the samples count as flat squares, over which G is integrated. That is right if G has
//
//   Q = (S + I/2) / 4^l - I/2        (samples of level l)
//
// instead of its covariance S: the blur of level l (its filter, and squares of 4^l / 12 px^2) less that of the pixels' own
// squares is subtracted. On the picture itself, l = 0, Q is S. This holds for boxes and Gaussians.
import { toHalf } from "./half";
import { kLayers, modesOf, type MatteData, type Mode } from "./matte";
import { pyramidShape, type PyramidShape } from "./pyramid_shape";

/** Texels of four 32-bit words; a footprint has two. Every graphics processor has textures as wide as this. */
const kMinListWidth = 2048;

export interface Footprints {
  /** Two words per pixel: the index of its first footprint, and their number. */
  index: Uint32Array<ArrayBuffer>;
  /** x, y, Q.xx, Q.yy | Q.xy, weights of red and green, weight of blue and texture and level, the largest weight. */
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

export function packFootprints(matte: MatteData): Footprints {
  const kind = matte.metadata.footprint === "box" ? "box" : "gaussian";
  const shapes = matte.metadata.monitors.map(({ width_px, height_px }) => pyramidShape(width_px, height_px));
  const pixels = matte.width * matte.height;
  const index = new Uint32Array(2 * pixels);
  const most = matte.modes.length / kLayers.length;
  const list = new Uint32Array(8 * most);
  const floats = new Float32Array(list.buffer);
  let count = 0;
  for (let pixel = 0; pixel < pixels; ++pixel) {
    const shared = sharedModes(matte, pixel);
    index[2 * pixel] = count;
    index[2 * pixel + 1] = shared.length;
    for (const { mode, weights } of shared) {
      const place = placeOf(mode, shapes[mode.texture]!, kind);
      const [red, green, blue] = weights.map(toHalf) as [number, number, number];
      const at = 8 * count++;
      floats.set([place.x, place.y, place.xx, place.yy, place.xy], at);
      list[at + 5] = red | (green << 16);
      list[at + 6] = blue | (mode.texture << 16) | (place.level << 24);
      floats[at + 7] = Math.max(...weights);
    }
  }
  let listWidth = kMinListWidth;
  while (2 * count > listWidth * listWidth) listWidth *= 2;
  const listHeight = Math.max(1, Math.ceil((2 * count) / listWidth));
  const texels = new Uint32Array(4 * listWidth * listHeight);
  texels.set(list.subarray(0, 8 * count));
  return { index, list: texels, listWidth, listHeight };
}
