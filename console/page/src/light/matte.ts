// An environment matte (docs/matte.md): for every camera pixel and channel,
//
//   C = F + sum over modes of R * integral over the monitor of G(x; c, S) T(x) dx
//
// Most pixels have far fewer modes than the file has layers, so only modes with a weight are kept.
import { NotAMatte, readExr, readLine, type Exr } from "./exr";

/** A mode's values in storage order; each is a layer of the file. */
export const kLayers = ["weight", "x", "y", "xx", "xy", "yy", "texture", "weight_sd", "centre_sd"] as const;
const kStride = kLayers.length;
const [kWeight, kXx, kYy, kTexture] = [0, 3, 5, 6] as const;
export const kChannels = ["R", "G", "B"] as const;

/** Bits of a pixel's flags. */
export const kFlags = { notConverged: 1, saturated: 2, residual: 4, notSolved: 8, filled: 16, disturbed: 32 } as const;

export interface MatteMonitor {
  name: string;
  width_px: number;
  height_px: number;
}

/** The header's JSON (MatteMetadata in proto/glasswing/v1/matte.proto), with its field names. */
export interface MatteMetadata {
  session?: string;
  method?: string;
  monitors: MatteMonitor[];
  crosstalk?: { share?: number[] }[];
  footprint?: string;
  warnings?: string[];
  frame?: number;
  sampling_px?: number;
}

/** The distance of a matte's pixels in the camera's picture: more than 1 if some are left out. */
export function samplingOf({ sampling_px }: MatteMetadata): number {
  return Math.max(1, sampling_px ?? 1);
}

export interface Mode {
  weight: number;
  x: number;
  y: number;
  xx: number;
  xy: number;
  yy: number;
  texture: number;
  weight_sd: number;
  centre_sd: number;
}

/** The matte's values as passed between threads. Pixels are numbered row by row. */
export interface MatteData {
  metadata: MatteMetadata;
  width: number;
  height: number;
  /** 1: the modes are equal in all channels and stored once. */
  modeChannels: 1 | 3;
  /** Red, green, blue of each pixel. */
  foreground: Float32Array<ArrayBuffer>;
  coverage: Float32Array<ArrayBuffer>;
  flags: Uint8Array<ArrayBuffer>;
  /** 1: the pixel has a footprint of any shape (docs/footprints.md). Absent: the matte can hold none. */
  anyShape?: Uint8Array<ArrayBuffer>;
  /** For pixel * modeChannels + channel, the index of its first mode; one more entry at the end. */
  firstMode: Uint32Array<ArrayBuffer>;
  modes: Float32Array<ArrayBuffer>;
}

function modeAt(matte: MatteData, index: number): Mode {
  const at = (layer: number): number => matte.modes[index * kStride + layer]!;
  return {
    weight: at(0),
    x: at(1),
    y: at(2),
    xx: at(3),
    xy: at(4),
    yy: at(5),
    texture: at(6),
    weight_sd: at(7),
    centre_sd: at(8),
  };
}

/** The modes of a pixel in a channel. */
export function modesOf(matte: MatteData, pixel: number, channel: number): Mode[] {
  const at = pixel * matte.modeChannels + Math.min(channel, matte.modeChannels - 1);
  const modes: Mode[] = [];
  for (let m = matte.firstMode[at]!; m < matte.firstMode[at + 1]!; ++m) modes.push(modeAt(matte, m));
  return modes;
}

/** Weights above this, which no object has, do not count: such a mode only compensates an excess of others. */
const kMaxWeight = Math.fround(1.05);

/** The first of a pixel's modes with the largest plausible weight in a channel (core/composite/stmap.h). */
export function strongestMode(matte: MatteData, pixel: number, channel: number): Mode | undefined {
  const at = pixel * matte.modeChannels + Math.min(channel, matte.modeChannels - 1);
  let best = -1;
  for (let m = matte.firstMode[at]!; m < matte.firstMode[at + 1]!; ++m) {
    const weight = matte.modes[m * kStride]!;
    if (weight > 0 && weight <= kMaxWeight && (best < 0 || weight > matte.modes[best * kStride]!)) best = m;
  }
  return best < 0 ? undefined : modeAt(matte, best);
}

/** Pixels of a picture. */
export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** The smallest box around all pixels with modes; the whole picture if there are none. */
export function seeingBox({ width, height, modeChannels, firstMode }: MatteData): Box {
  let [left, top, right, bottom] = [width, height, -1, -1];
  for (let pixel = 0; pixel < width * height; ++pixel) {
    if (firstMode[pixel * modeChannels] === firstMode[(pixel + 1) * modeChannels]) continue;
    const [x, y] = [pixel % width, Math.floor(pixel / width)];
    [left, right] = [Math.min(left, x), Math.max(right, x)];
    [top, bottom] = [Math.min(top, y), Math.max(bottom, y)];
  }
  if (right < 0) return { x: 0, y: 0, width, height };
  return { x: left, y: top, width: right - left + 1, height: bottom - top + 1 };
}

function readMetadata(exr: Exr): MatteMetadata {
  const text = exr.parts[0]?.attributes.get("glasswing");
  if (text === undefined) throw new NotAMatte('its header has no attribute "glasswing"');
  let metadata: Partial<MatteMetadata>;
  try {
    metadata = JSON.parse(text) as Partial<MatteMetadata>;
  } catch {
    throw new NotAMatte('its attribute "glasswing" is not JSON');
  }
  const monitors = metadata.monitors ?? [];
  if (monitors.length === 0 || !monitors.every(({ width_px, height_px }) => width_px > 0 && height_px > 0))
    throw new NotAMatte("its header names no monitors with sizes");
  if (!["", "gaussian", "box", "pyramid"].includes(metadata.footprint ?? ""))
    throw new NotAMatte(`its footprints are "${metadata.footprint}"; they must be gaussian, box or pyramid`);
  return { ...metadata, monitors };
}

/** Storage for modes, which grows as rows are read. */
class ModeList {
  values = new Float32Array(1 << 16);
  count = 0;
  add(layer: (layer: number) => number): void {
    if ((this.count + 1) * kStride > this.values.length) {
      const longer = new Float32Array(this.values.length * 2);
      longer.set(this.values);
      this.values = longer;
    }
    for (let l = 0; l < kStride; ++l) this.values[this.count * kStride + l] = layer(l);
    ++this.count;
  }
}

/** A channel's light of one monitor that no few Gaussians describe (docs/footprints.md): stands for its modes there. */
interface Pyramid {
  texture: number;
  foreground: number;
  coefficients: { level: number; column: number; row: number; weight: number }[];
}
const kPyramidLevels = 5;
const kPlaceSide = 1024;
const kPyramidHead = 9;

/** A row's, by 3 x + channel. NotAMatte: numbers that no row has. */
export function pyramidsOf(numbers: Float32Array, width: number): Map<number, Pyramid[]> {
  const all = new Map<number, Pyramid[]>();
  for (let at = 0; at < numbers.length && numbers[at] !== 0;) {
    const [x, channel, texture, foreground, , , count, left, top] = numbers.subarray(at, at + kPyramidHead);
    const whole = [x, channel, texture, count, left, top].every((value) => Number.isInteger(value) && value! >= 0);
    if (!whole || x! > width || channel! > 2 || at + kPyramidHead + 2 * count! > numbers.length)
      throw new NotAMatte("its pyramids have values that are invalid in a matte");
    at += kPyramidHead;
    let place = 0;
    const coefficients = Array.from({ length: count! }, (_, i) => {
      place += numbers[at + i]!;
      const level = Math.floor(place / kPlaceSide ** 2);
      return {
        level,
        column: Math.floor(left! / 2 ** level) + Math.floor((place % kPlaceSide ** 2) / kPlaceSide),
        row: Math.floor(top! / 2 ** level) + (place % kPlaceSide),
        weight: numbers[at + count! + i]!,
      };
    });
    at += 2 * count!;
    const key = 3 * (x! - 1) + channel!;
    all.set(key, [...(all.get(key) ?? []), { texture: texture!, foreground: foreground!, coefficients }]);
  }
  return all;
}

/** The position of each layer in a part's lines. NotAMatte names a missing one. */
function columnsOf(exr: Exr, part: number, names: string[]): number[] {
  const { channels, name } = exr.parts[part]!;
  return names.map((wanted) => {
    const column = channels.indexOf(wanted);
    if (column < 0) throw new NotAMatte(`its part "${name}" has no channel ${wanted}`);
    return column * exr.window.width;
  });
}

/** Of the last mode that was added. */
function isGood({ values, count }: ModeList, monitors: number): boolean {
  const first = (count - 1) * kStride;
  const at = (layer: number): number => values[first + layer]!;
  for (let layer = 0; layer < kStride; ++layer) {
    if (!Number.isFinite(at(layer))) return false;
  }
  return at(kWeight) >= 0 && at(kXx) >= 0 && at(kYy) >= 0 && at(kTexture) >= 0 && at(kTexture) < monitors;
}

const kForeground = 1;
const kFirstMode = 2;
const kRowsAtOnce = 16;

/**
 * `report` gets the fraction that is done. `any`: pyramids are read, as Gaussians in place of the modes that they stand for;
 * without it, modes are what they are, and a warning says how many pixels have pyramids.
 */
export async function readMatte(
  bytes: Uint8Array<ArrayBuffer>,
  report: (done: number) => void,
  any = false,
): Promise<MatteData> {
  const exr = readExr(bytes);
  const metadata = readMetadata(exr);
  const hasPyramids = metadata.footprint === "pyramid";
  const modeCount = exr.parts.length - kFirstMode - (hasPyramids ? 1 : 0);
  if (hasPyramids && exr.parts.at(-1)?.name !== "pyramid") throw new NotAMatte('it lacks its part "pyramid"');
  if (exr.parts[kForeground]?.name !== "foreground" || modeCount < 1)
    throw new NotAMatte("its parts must be preview, foreground, mode1 and so on");
  const gray = exr.parts[kFirstMode]!.channels.includes("mode1.weight.Y");
  const suffixes = gray ? ["Y"] : [...kChannels];
  const { width, height } = exr.window;
  const modes = new ModeList();
  const matte: MatteData = {
    metadata,
    width,
    height,
    modeChannels: gray ? 1 : 3,
    foreground: new Float32Array(3 * width * height),
    coverage: new Float32Array(width * height),
    flags: new Uint8Array(width * height),
    firstMode: new Uint32Array(width * height * suffixes.length + 1),
    modes: modes.values,
    ...(hasPyramids && { anyShape: new Uint8Array(width * height) }),
  };
  const foregroundAt = columnsOf(exr, kForeground, [
    ...kChannels.map((channel) => `foreground.F.${channel}`),
    "foreground.coverage.Y",
    "foreground.flags.Y",
  ]);
  const columnsAt = Array.from({ length: modeCount }, (_, m) =>
    suffixes.map((suffix) =>
      columnsOf(
        exr,
        kFirstMode + m,
        kLayers.map((layer) => `mode${m + 1}.${layer}.${suffix}`),
      ),
    ),
  );

  const takeForeground = (line: Float32Array, row: number): void => {
    const [r, g, b, coverage, flags] = foregroundAt.map((column) =>
      line.subarray(column, column + width),
    ) as [Float32Array, Float32Array, Float32Array, Float32Array, Float32Array];
    for (let x = 0, pixel = row * width; x < width; ++x, ++pixel) {
      matte.foreground[3 * pixel] = r[x]!;
      matte.foreground[3 * pixel + 1] = g[x]!;
      matte.foreground[3 * pixel + 2] = b[x]!;
      matte.coverage[pixel] = coverage[x]!;
      matte.flags[pixel] = flags[x]! >= 0 && flags[x]! < 256 ? flags[x]! : kFlags.notSolved;
    }
  };
  const takeModes = (lines: Float32Array[], row: number, pyramids: Map<number, Pyramid[]>): void => {
    const layers = columnsAt.map((channels, m) =>
      channels.map((columns) => columns.map((column) => lines[m]!.subarray(column, column + width))),
    );
    for (let x = 0, at = row * width * suffixes.length; x < width; ++x) {
      for (let channel = 0; channel < suffixes.length; ++channel) {
        matte.firstMode[at++] = modes.count;
        const own = pyramids.get(3 * x + channel) ?? [];
        const add = (layer: (layer: number) => number): void => {
          modes.add(layer);
          if (!isGood(modes, metadata.monitors.length))
            throw new NotAMatte(
              `pixel (${x + exr.window.x0}, ${row + exr.window.y0}) has values that are invalid in a matte`,
            );
        };
        for (let m = 0; m < modeCount; ++m) {
          const mode = layers[m]![channel]!;
          if (mode[0]![x] === 0 || own.some(({ texture }) => texture === mode[kTexture]![x])) continue;
          add((layer) => mode[layer]![x]!);
        }
        for (const { texture, foreground, coefficients } of own) {
          matte.foreground[3 * (row * width + x) + channel]! += foreground;
          for (const { level, column, row: down, weight } of coefficients) {
            const sigma = 2 ** level;
            const mode = layers[level - kPyramidLevels]?.[channel];
            const round = [weight, sigma * (2 * column + 1), sigma * (2 * down + 1), sigma ** 2, 0, sigma ** 2, texture, 0, 0];
            add((layer) => (layer === kWeight || !mode ? round[layer]! : mode[layer]![x]!));
          }
        }
      }
    }
  };

  for (let first = 0; first < height; first += kRowsAtOnce) {
    const rows = Array.from({ length: Math.min(kRowsAtOnce, height - first) }, (_, i) => first + i);
    const lines = await Promise.all(
      rows.map((row) =>
        Promise.all(
          Array.from({ length: 1 + modeCount + (hasPyramids ? 1 : 0) }, (_, part) =>
            readLine(exr, kForeground + part, row),
          ),
        ),
      ),
    );
    lines.forEach(([foreground, ...modeLines], i) => {
      const pyramids = hasPyramids ? pyramidsOf(modeLines[modeCount]!, width) : new Map<number, Pyramid[]>();
      for (const key of pyramids.keys()) matte.anyShape![(first + i) * width + Math.floor(key / 3)] = 1;
      takeForeground(foreground!, first + i);
      takeModes(modeLines, first + i, any ? pyramids : new Map<number, Pyramid[]>());
    });
    report(Math.min(1, (first + kRowsAtOnce) / height));
  }
  matte.firstMode[matte.firstMode.length - 1] = modes.count;
  matte.modes = modes.values.slice(0, modes.count * kStride);
  const withPyramids = matte.anyShape?.reduce((count, each) => count + each, 0) ?? 0;
  if (withPyramids > 0 && !any) {
    const object = matte.coverage.reduce((count, coverage) => count + Number(coverage > 0), 0);
    metadata.warnings = [
      ...(metadata.warnings ?? []),
      `${((100 * withPyramids) / object).toFixed(1)} % of the object's pixels have footprints of any shape: composites ` +
        "show them; places and widths here are those of the closest Gaussians",
    ];
  }
  return matte;
}
