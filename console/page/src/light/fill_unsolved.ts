// Fills a composite's unsolved pixels, such as those that saw the id patch, as `glasswing composite --fill` does.
import { kFlags } from "./matte";
import { codeOf, lightOf } from "./srgb";

/** A pixel's index for each unsolved pixel of `flags`. */
export function unsolvedPixels(flags: Uint8Array): Uint32Array<ArrayBuffer> {
  const pixels: number[] = [];
  flags.forEach((flag, pixel) => (flag & kFlags.notSolved) !== 0 && pixels.push(pixel));
  return Uint32Array.from(pixels);
}

const kLights = Float32Array.from({ length: 256 }, (_, code) => lightOf(code / 255));

/**
 * Replaces `unsolved` in an sRGB picture of four channels, from the rim inwards: each becomes the mean light of those of its
 * eight neighbours that are solved or filled. Without any solved pixel the picture stays.
 */
export function fillUnsolved(picture: Pick<ImageData, "width" | "height" | "data">, unsolved: Uint32Array): void {
  const { width, height, data } = picture;
  const known = new Uint8Array(width * height).fill(1);
  for (const pixel of unsolved) known[pixel] = 0;
  const forNeighbours = (pixel: number, each: (at: number) => void): void => {
    const [x, y] = [pixel % width, Math.floor(pixel / width)];
    for (let v = Math.max(0, y - 1); v <= Math.min(height - 1, y + 1); ++v) {
      for (let u = Math.max(0, x - 1); u <= Math.min(width - 1, x + 1); ++u) each(v * width + u);
    }
  };
  const fill = (pixel: number): void => {
    const sum = [0, 0, 0];
    let count = 0;
    forNeighbours(pixel, (at) => {
      if (!known[at]) return;
      ++count;
      for (let c = 0; c < 3; ++c) sum[c]! += kLights[data[4 * at + c]!]!;
    });
    data.set([...sum.map((light) => Math.round(255 * codeOf(light / count))), 255], 4 * pixel);
  };
  // Each round fills the unsolved pixels beside known ones: at first, and then beside those just filled.
  const onRim = new Uint8Array(width * height);
  const beside = (pixels: number[]): number[] => {
    const found: number[] = [];
    for (const pixel of pixels) {
      forNeighbours(pixel, (at) => {
        if (known[at] || onRim[at]) return;
        onRim[at] = 1;
        found.push(at);
      });
    }
    return found;
  };
  const isBesideKnown = (pixel: number): boolean => {
    let found = false;
    forNeighbours(pixel, (at) => (found ||= known[at] === 1));
    return found;
  };
  let rim = [...unsolved].filter(isBesideKnown);
  for (const pixel of rim) onRim[pixel] = 1;
  for (; rim.length > 0; rim = beside(rim)) {
    rim.forEach(fill);
    for (const pixel of rim) known[pixel] = 1;
  }
}
