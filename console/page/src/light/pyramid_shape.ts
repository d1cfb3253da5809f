// The levels of a picture's pyramid in one texture: the picture at the left, the coarser levels one under another at its
// right. Each has a border of kBorder samples.
//
//   level_l[j] = sum over k of h[k] level_{l-1}[2j + k - 2],   h = [1 5 10 10 5 1] / 32    (core/composite/pyramid.h)
//
// A sample of level l is centred on 2^l x 2^l pixels; its filter has the variance 5 (4^l - 1) / 12 px^2.

export const kBorder = 2;
const kMinSide_px = 4;

export interface Level {
  /** Position of sample (0, 0) in the texture. */
  x: number;
  y: number;
  width: number;
  height: number;
}

export interface PyramidShape {
  width: number;
  height: number;
  levels: Level[];
}

export function pyramidShape(width_px: number, height_px: number): PyramidShape {
  const levels: Level[] = [{ x: kBorder, y: kBorder, width: width_px, height: height_px }];
  const shape = { width: width_px + 2 * kBorder, height: height_px + 2 * kBorder, levels };
  let below = kBorder;
  for (let last = levels[0]!; Math.max(last.width, last.height) > kMinSide_px;) {
    last = {
      x: width_px + 3 * kBorder,
      y: below,
      width: (last.width + 1) >> 1,
      height: (last.height + 1) >> 1,
    };
    levels.push(last);
    below += last.height + 2 * kBorder;
    shape.width = Math.max(shape.width, last.x + last.width + kBorder);
    shape.height = Math.max(shape.height, below - kBorder);
  }
  return shape;
}
