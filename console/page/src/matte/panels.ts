// A matte's values as pictures, with the colours and scales of `glasswing view` (compositing/view/matte_panels);
// tests/browser/panels_test.mjs compares the two.
import { kChannels, kFlags, strongestMode, type MatteData, type MatteMetadata } from "../light/matte";
import { codeOf } from "../light/srgb";

export type Colour = readonly [number, number, number];

/** sRGB, four bytes per pixel. */
export interface Raster {
  width: number;
  height: number;
  pixels: Uint8ClampedArray<ArrayBuffer>;
}

export interface Panel {
  name: string;
  title: string;
  picture: Raster;
  /** Colours, or charts of a monitor's positions, and their names. */
  keys: { colours: Raster; name: string }[];
  /** From low to high; ticks at positions 0 to 1. */
  bar?: { colours: Raster; ticks: { place: number; label: string }[] };
}

const kNoValue: Colour = [214, 214, 214];
const kBar_px = 256;
const kChart_px = 96;
const kDarkestWhite = 0.02;

const code = (share: number): number => Math.round(255 * Math.min(1, Math.max(0, share)));
const gray = (share: number): Colour => [code(share), code(share), code(share)];

// Dark blue to yellow; the stops are equally spaced in CIE L*.
const kStops = [
  [0.17, 0.08, 0.36],
  [0.2, 0.28, 0.54],
  [0.12, 0.47, 0.56],
  [0.17, 0.64, 0.5],
  [0.52, 0.8, 0.29],
  [0.98, 0.91, 0.17],
] as const;

export function scaleColour(share: number): Colour {
  const place = Math.min(1, Math.max(0, share)) * (kStops.length - 1);
  const stop = Math.min(Math.floor(place), kStops.length - 2);
  const [low, high] = [kStops[stop]!, kStops[stop + 1]!];
  const part = place - stop;
  const between = (c: 0 | 1 | 2): number => code((1 - part) * low[c] + part * high[c]);
  return [between(0), between(1), between(2)];
}

function painted(width: number, height: number, colour: (x: number, y: number) => Colour): Raster {
  const pixels = new Uint8ClampedArray(4 * width * height);
  for (let y = 0, at = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x, at += 4) {
      const [r, g, b] = colour(x, y);
      pixels[at] = r;
      pixels[at + 1] = g;
      pixels[at + 2] = b;
      pixels[at + 3] = 255;
    }
  }
  return { width, height, pixels };
}

const byPixel = (matte: MatteData, colour: (pixel: number) => Colour): Raster =>
  painted(matte.width, matte.height, (x, y) => colour(y * matte.width + x));
const keyOf = (colour: Colour, name: string) => ({ colours: painted(1, 1, () => colour), name });
const lineOf = (colour: (share: number) => Colour): Raster =>
  painted(kBar_px, 1, (x) => colour((x + 0.5) / kBar_px));
const label = (value: number): string => String(Number(value.toPrecision(4)));
const quarters = (scale: number) =>
  [0, 0.25, 0.5, 0.75, 1].map((place) => ({ place, label: label(place * scale) }));

// 1, 2 or 5 times a power of ten: the largest not above the value, and the smallest not below it.
function roundDown(value: number): number {
  const ten = 10 ** Math.floor(Math.log10(value) + 1e-9);
  const part = (value / ten) * (1 + 1e-9);
  return ten * (part >= 5 ? 5 : part >= 2 ? 2 : 1);
}
function roundUp(value: number): number {
  const below = roundDown(value);
  if (below * (1 + 1e-6) >= value) return below;
  return roundDown(below * ((Math.log10(below) + 1e-9) % 1 === 0 ? 2 : 2.51));
}

/** Values of the object's pixels that count, or of all such pixels if there is no object. */
function valuesOf(matte: MatteData, get: (pixel: number) => number): Float64Array {
  const object: number[] = [];
  const all: number[] = [];
  for (let pixel = 0; pixel < matte.coverage.length; ++pixel) {
    const value = get(pixel);
    if (!isPositive(value)) continue;
    all.push(value);
    if (matte.coverage[pixel]! > 0) object.push(value);
  }
  return Float64Array.from(object.length > 0 ? object : all).sort();
}

const isPositive = (value: number): boolean => Number.isFinite(value) && value > 0;
const percentile = (sorted: Float64Array, share: number): number =>
  sorted[Math.trunc(share * (sorted.length - 1))]!;

/** "12 %": the share of the object's pixels, or of all pixels if there is no object. */
function shareOf(matte: MatteData, is: (pixel: number) => boolean): string {
  const someObject = matte.coverage.some((coverage) => coverage > 0);
  let [found, all] = [0, 0];
  for (let pixel = 0; pixel < matte.coverage.length; ++pixel) {
    if (someObject && !(matte.coverage[pixel]! > 0)) continue;
    ++all;
    if (is(pixel)) ++found;
  }
  const percent = (100 * found) / all;
  return found > 0 && percent < 0.1 ? "< 0.1 %" : `${Number(percent.toPrecision(3))} %`;
}

function foregroundOf(matte: MatteData): Panel {
  const at = (pixel: number): [number, number, number] => [
    matte.foreground[3 * pixel]!,
    matte.foreground[3 * pixel + 1]!,
    matte.foreground[3 * pixel + 2]!,
  ];
  const lights = valuesOf(matte, (pixel) => Math.max(...at(pixel)));
  const white =
    lights.length === 0 ? 1 : Math.min(1, Math.max(kDarkestWhite, roundUp(percentile(lights, 0.995))));
  const level = (light: number): number => code(codeOf(light / white));
  return {
    name: "foreground",
    title: "F: light without the monitors, of full scale",
    picture: byPixel(matte, (pixel) => at(pixel).map(level) as [number, number, number]),
    keys: [],
    bar: { colours: lineOf((share) => gray(level(share * white) / 255)), ticks: quarters(white) },
  };
}

function coverageOf(matte: MatteData): Panel {
  return {
    name: "coverage",
    title: "Coverage: how much of the pixel is object",
    picture: byPixel(matte, (pixel) => gray(matte.coverage[pixel]!)),
    keys: [],
    bar: { colours: lineOf(gray), ticks: quarters(1) },
  };
}

const kCounts: Colour[] = [kNoValue, [51, 102, 170], [60, 180, 150], [240, 200, 60], [205, 70, 60]];

/** Of the channel with most. */
function modeCount(matte: MatteData, pixel: number): number {
  let most = 0;
  for (let at = pixel * matte.modeChannels; at < (pixel + 1) * matte.modeChannels; ++at)
    most = Math.max(most, matte.firstMode[at + 1]! - matte.firstMode[at]!);
  return most;
}

function modesPanel(matte: MatteData): Panel {
  const count = (pixel: number): number => modeCount(matte, pixel);
  const kinds = [...new Set(Array.from(matte.coverage, (_, pixel) => count(pixel)))].sort();
  return {
    name: "modes",
    title: "Modes of the channel with most; % of the object",
    picture: byPixel(matte, (pixel) => kCounts[count(pixel)] ?? kNoValue),
    keys: kinds.map((n) =>
      keyOf(kCounts[n] ?? kNoValue, `${n}: ${shareOf(matte, (pixel) => count(pixel) === n)}`),
    ),
  };
}

const kShapes = [
  { name: "none", colour: kNoValue },
  { name: "modes", colour: [150, 175, 205] as Colour },
  { name: "any shape", colour: [200, 80, 120] as Colour },
] as const;

/** Which pixels few Gaussians do not describe (docs/footprints.md). */
function shapePanel(matte: MatteData, anyShape: Uint8Array): Panel {
  const kind = (pixel: number) => kShapes[anyShape[pixel] ? 2 : Math.min(1, modeCount(matte, pixel))]!;
  return {
    name: "shape",
    title: "Footprints of any shape; % of the object",
    picture: byPixel(matte, (pixel) => kind(pixel).colour),
    keys: kShapes.map((each) =>
      keyOf(each.colour, `${each.name}: ${shareOf(matte, (pixel) => kind(pixel) === each)}`),
    ),
  };
}

// Red rises to the right and green downwards; blue distinguishes monitors. A checkerboard of an eighth of the height darkens
// every other square.
function placeColour({ monitors }: MatteMetadata, texture: number, x: number, y: number): Colour {
  const monitor = monitors[texture];
  if (!monitor) return kNoValue;
  const check = monitor.height_px / 8;
  const light = (Math.floor(x / check) + Math.floor(y / check)) % 2 !== 0 ? 0.78 : 1;
  const blue = monitors.length === 1 ? 0.35 : 0.15 + (0.8 * texture) / (monitors.length - 1);
  const shade = (share: number): number => 0.1 + 0.9 * Math.min(1, Math.max(0, share));
  return [
    code(light * shade(x / monitor.width_px)),
    code(light * shade(y / monitor.height_px)),
    code(light * blue),
  ];
}

const owner = (matte: MatteData, channel: number): string =>
  matte.modeChannels === 1 ? "the" : ["red's", "green's", "blue's"][channel]!;

function centreOf(matte: MatteData, channel: number): Panel {
  const { metadata } = matte;
  return {
    name: "centre",
    title: `Centre: where ${owner(matte, channel)} strongest mode looks`,
    picture: byPixel(matte, (pixel) => {
      const mode = strongestMode(matte, pixel, channel);
      return mode ? placeColour(metadata, mode.texture, mode.x, mode.y) : kNoValue;
    }),
    keys: metadata.monitors.map(({ name, width_px, height_px }, t) => {
      const step = height_px / kChart_px;
      const width = Math.min(4 * kChart_px, Math.max(1, Math.round(width_px / step)));
      const colours = painted(width, kChart_px, (x, y) =>
        placeColour(metadata, t, (x + 0.5) * step, (y + 0.5) * step),
      );
      return { colours, name: `${name} ${width_px}x${height_px}` };
    }),
  };
}

/** A logarithmic scale from the 1st to the 99th percentile. */
function logarithmic(matte: MatteData, name: string, title: string, get: (pixel: number) => number): Panel {
  const values = valuesOf(matte, get);
  const low = values.length > 0 ? roundDown(percentile(values, 0.01)) : 1;
  const high = values.length > 0 ? Math.max(roundUp(percentile(values, 0.99)), roundUp(2 * low)) : 2;
  const share = (value: number): number => Math.log(value / low) / Math.log(high / low);
  const picture = byPixel(matte, (pixel) => {
    const value = get(pixel);
    return isPositive(value) ? scaleColour(share(value)) : kNoValue;
  });
  if (values.length === 0) return { name, title, picture, keys: [keyOf(kNoValue, "not known")] };
  const parts = high / low > 150 ? [1] : [1, 2, 5];
  const ticks: { place: number; label: string }[] = [];
  const next = high / low > 3e4 ? 100 : 10; // so that labels have room on a phone
  for (let ten = 10 ** Math.floor(Math.log10(low) + 1e-9); ten <= high * 1.001; ten *= next) {
    for (const value of parts.map((part) => part * ten)) {
      if (value >= low * 0.999 && value <= high * 1.001)
        ticks.push({ place: share(value), label: label(value) });
    }
  }
  return { name, title, picture, keys: [], bar: { colours: lineOf(scaleColour), ticks } };
}

function sigmaOf(matte: MatteData, channel: number): Panel {
  const what = matte.metadata.footprint === "box" ? "box" : "mode";
  return logarithmic(
    matte,
    "sigma",
    `Sigma of ${owner(matte, channel)} strongest ${what}, monitor px`,
    (pixel) => {
      const mode = strongestMode(matte, pixel, channel);
      return mode ? Math.sqrt(0.5 * (mode.xx + mode.yy)) : 0;
    },
  );
}

function uncertaintyOf(matte: MatteData, channel: number): Panel {
  return logarithmic(
    matte,
    "uncertainty",
    `Standard error of ${owner(matte, channel)} centre, monitor px`,
    (pixel) => strongestMode(matte, pixel, channel)?.centre_sd ?? 0,
  );
}

/** The most serious flag comes first. */
export const kFlagWords: { flag: number; words: string; colour: Colour }[] = [
  { flag: kFlags.notSolved, words: "not solved", colour: [40, 40, 40] },
  { flag: kFlags.saturated, words: "saturated", colour: [214, 64, 52] },
  { flag: kFlags.notConverged, words: "did not converge", colour: [240, 170, 40] },
  { flag: kFlags.disturbed, words: "disturbed", colour: [120, 200, 210] },
  { flag: kFlags.residual, words: "poor fit", colour: [86, 124, 200] },
  { flag: kFlags.filled, words: "filled", colour: [170, 110, 190] },
  { flag: 0, words: "good", colour: [150, 205, 160] },
];

function flagsOf(matte: MatteData): Panel {
  const found = (pixel: number) =>
    kFlagWords.find(({ flag }) => flag === 0 || (matte.flags[pixel]! & flag) !== 0)!;
  return {
    name: "flags",
    title: "Flags, the most serious; % of the object",
    picture: byPixel(matte, (pixel) => {
      const { flag, colour } = found(pixel);
      return flag === 0 && !(matte.coverage[pixel]! > 0) ? kNoValue : colour;
    }),
    keys: kFlagWords
      .map((each) => keyOf(each.colour, `${each.words}: ${shareOf(matte, (pixel) => found(pixel) === each)}`))
      .reverse(),
  };
}

/** centre, sigma and uncertainty show the strongest modes of `channel`. */
export function panelsOf(matte: MatteData, channel: number): Panel[] {
  return [
    foregroundOf(matte),
    coverageOf(matte),
    modesPanel(matte),
    ...(matte.anyShape ? [shapePanel(matte, matte.anyShape)] : []),
    centreOf(matte, channel),
    sigmaOf(matte, channel),
    uncertaintyOf(matte, channel),
    flagsOf(matte),
  ];
}

export const kChannelNames: Record<(typeof kChannels)[number], string> = { R: "red", G: "green", B: "blue" };
