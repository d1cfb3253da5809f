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
  const fill = (pixel: number): boolean => {
    const sum = [0, 0, 0];
    let count = 0;
    const [x, y] = [pixel % width, Math.floor(pixel / width)];
    for (let v = Math.max(0, y - 1); v <= Math.min(height - 1, y + 1); ++v) {
      for (let u = Math.max(0, x - 1); u <= Math.min(width - 1, x + 1); ++u) {
        const at = v * width + u;
        if (!known[at]) continue;
        ++count;
        for (let c = 0; c < 3; ++c) sum[c]! += kLights[data[4 * at + c]!]!;
      }
    }
    if (count > 0) data.set([...sum.map((light) => Math.round(255 * codeOf(light / count))), 255], 4 * pixel);
    return count > 0;
  };
  for (let open = [...unsolved]; open.length > 0; ) {
    const filled = open.filter(fill);
    if (filled.length === 0) return;
    for (const pixel of filled) known[pixel] = 1;
    open = open.filter((pixel) => !known[pixel]);
  }
}
