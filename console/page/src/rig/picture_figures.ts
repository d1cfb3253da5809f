// Exposure and focus of a preview picture, from its sRGB codes, 0 to 255, in canvas order: r, g, b, alpha.

export interface Pixels {
  data: Uint8ClampedArray;
  width: number;
  height: number;
}

/** Counts of each code: 256 for red, then green, then blue. */
export function histogram({ data }: Pixels): Uint32Array {
  const counts = new Uint32Array(3 * 256);
  for (let i = 0; i < data.length; i += 4) {
    counts[data[i]!]!++;
    counts[256 + data[i + 1]!]!++;
    counts[512 + data[i + 2]!]!++;
  }
  return counts;
}

/** Pixels of a JPEG from this code on may be saturated: its errors are of that size. */
export const kClipped = 253;
/** Minimum slope of a sharp edge, in codes per pixel. */
export const kSharp = 40;

function luma({ data, width, height }: Pixels): Float32Array {
  const light = new Float32Array(width * height);
  for (let i = 0, at = 0; i < light.length; ++i, at += 4)
    light[i] = 0.2126 * data[at]! + 0.7152 * data[at + 1]! + 0.0722 * data[at + 2]!;
  return light;
}

/** The luma's slope at each pixel, in codes per pixel: Sobel's operator / 8; 0 at the border. */
export function slopes(picture: Pixels): Float32Array {
  const { width, height } = picture;
  const light = luma(picture);
  const slope = new Float32Array(width * height);
  for (let y = 1; y < height - 1; ++y) {
    for (let x = 1; x < width - 1; ++x) {
      const i = y * width + x,
        up = i - width,
        down = i + width;
      const [a, b, c, d, f, g, h, k] = [
        light[up - 1]!,
        light[up]!,
        light[up + 1]!,
        light[i - 1]!,
        light[i + 1]!,
        light[down - 1]!,
        light[down]!,
        light[down + 1]!,
      ];
      slope[i] = Math.hypot(c + 2 * f + k - a - 2 * d - g, g + 2 * h + k - a - 2 * b - c) / 8;
    }
  }
  return slope;
}

/** Draws stripes over clipped pixels. */
export function drawZebra({ data, width }: Pixels): void {
  for (let i = 0; i < data.length; i += 4) {
    if (Math.max(data[i]!, data[i + 1]!, data[i + 2]!) < kClipped) continue;
    const pixel = i >> 2;
    const dark = ((pixel % width) + Math.floor(pixel / width)) % 8 < 4;
    data.set(dark ? [0, 0, 0] : [255, 60, 60], i);
  }
}

/** Draws sharp edges in one strong colour. */
export function drawPeaking(picture: Pixels): void {
  slopes(picture).forEach((slope, i) => slope >= kSharp && picture.data.set([0, 255, 120], 4 * i));
}
