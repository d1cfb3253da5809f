// A pixel's footprints on a monitor as a picture, as `glasswing view --pixel` draws them.
import { modesOf, type Box, type MatteData, type MatteMonitor, type Mode } from "../light/matte";
import { codeOf } from "../light/srgb";
import type { Raster } from "./panels";

const kReach = 4; // standard deviations, of what is drawn
const kSlices = 16; // of a row of pixels, for slanted Gaussians

/** Of the standard normal distribution (Abramowitz and Stegun 26.2.17: to 7.5e-8). */
function below(z: number): number {
  const t = 1 / (1 + 0.2316419 * Math.abs(z));
  const sum = t * (0.31938153 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))));
  const beyond = (sum * Math.exp(-0.5 * z * z)) / Math.sqrt(2 * Math.PI);
  return z > 0 ? 1 - beyond : beyond;
}

/** Whole pixels of the monitor. */
function boxOf(modes: readonly Mode[], { width_px, height_px }: MatteMonitor): Box {
  const ends = (at: (mode: Mode) => number, variance: (mode: Mode) => number, side: number): [number, number] => [
    Math.max(0, Math.floor(Math.min(...modes.map((mode) => at(mode) - kReach * Math.sqrt(variance(mode)))))),
    Math.min(side, Math.ceil(Math.max(...modes.map((mode) => at(mode) + kReach * Math.sqrt(variance(mode)))))),
  ];
  const [left, right] = ends(({ x }) => x, ({ xx }) => xx, width_px);
  const [top, bottom] = ends(({ y }) => y, ({ yy }) => yy, height_px);
  return { x: left, y: top, width: Math.max(1, right - left), height: Math.max(1, bottom - top) };
}

/**
 * What each of the box's pixels has of the light of Gaussians, row by row. Across, each thin slice of a row is normal, about a
 * mean that moves with the slice.
 */
export function sharesIn(box: Box, modes: readonly Mode[]): Float64Array {
  const shares = new Float64Array(box.width * box.height);
  for (const { weight, x, y, xx, xy, yy } of modes) {
    const [reach_x, reach_y] = [kReach * Math.sqrt(xx), kReach * Math.sqrt(yy)];
    const first = Math.max(box.x, Math.floor(x - reach_x)),
      last = Math.min(box.x + box.width, Math.ceil(x + reach_x));
    const slices = xy === 0 ? 1 : kSlices;
    const slope = xy / yy;
    const across = Math.sqrt(Math.max(xx - slope * xy, 0) + (slope / slices) ** 2 / 12);
    const bottom = Math.min(box.y + box.height, Math.ceil(y + reach_y));
    for (let v = Math.max(box.y, Math.floor(y - reach_y)); v < bottom; ++v) {
      for (let slice = 0; slice < slices; ++slice) {
        const top = v + slice / slices;
        const light = weight * (below((top + 1 / slices - y) / Math.sqrt(yy)) - below((top - y) / Math.sqrt(yy)));
        const middle = x + slope * (top + 0.5 / slices - y);
        let before = below((first - middle) / across);
        for (let u = first; u < last; ++u) {
          const up_to = below((u + 1 - middle) / across);
          shares[(v - box.y) * box.width + u - box.x]! += light * (up_to - before);
          before = up_to;
        }
      }
    }
  }
  return shares;
}

/** The brightest place is white. Undefined: the pixel sees nothing of the monitor. */
export function footprintPicture(
  matte: MatteData,
  pixel: number,
  texture: number,
): { box: Box; picture: Raster } | undefined {
  const channels = [0, 1, 2].map((channel) =>
    modesOf(matte, pixel, channel).filter((mode) => mode.texture === texture && mode.weight > 0),
  );
  if (channels.every((modes) => modes.length === 0)) return undefined;
  const box = boxOf(channels.flat(), matte.metadata.monitors[texture]!);
  const shares = channels.map((modes) => sharesIn(box, modes));
  const most = shares.reduce((high, each) => each.reduce((a, b) => Math.max(a, b), high), 0);
  const pixels = new Uint8ClampedArray(4 * box.width * box.height).fill(255);
  shares.forEach((each, channel) =>
    each.forEach((share, at) => (pixels[4 * at + channel] = Math.round(255 * codeOf(share / most)))),
  );
  return { box, picture: { width: box.width, height: box.height, pixels } };
}
