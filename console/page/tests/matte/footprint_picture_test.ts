import { expect, test } from "vitest";
import { readMatte, type Mode } from "../../src/light/matte";
import { footprintPicture, sharesIn } from "../../src/matte/footprint_picture";
import { matteBytes } from "../light/matte_bytes";

const mode = (part: Partial<Mode>): Mode => ({
  weight: 1,
  x: 20,
  y: 20,
  xx: 1,
  xy: 0,
  yy: 1,
  texture: 0,
  weight_sd: 0,
  centre_sd: 0,
  ...part,
});

// Flat pixels add a twelfth to its variances. Beyond four standard deviations lie 3e-4 of the light and 5e-3 of its variance.
test("a Gaussian's shares have its light, place and extent", () => {
  const [width, height] = [64, 48];
  const own = mode({ weight: 0.3, x: 31.3, y: 22.8, xx: 9, xy: 2, yy: 4 });
  const shares = sharesIn({ x: 0, y: 0, width, height }, [own]);
  const mean = (of: (x: number, y: number) => number): number =>
    shares.reduce((sum, share, at) => sum + share * of((at % width) + 0.5, Math.floor(at / width) + 0.5), 0) /
    own.weight;
  expect(Math.abs(mean(() => 1) - 1)).toBeLessThan(3e-4);
  expect(Math.abs(mean((x) => x) - own.x)).toBeLessThan(3e-4 * own.x);
  expect(Math.abs(mean((x) => (x - own.x) ** 2) / (own.xx + 1 / 12) - 1)).toBeLessThan(5e-3);
  expect(Math.abs(mean((_, y) => (y - own.y) ** 2) / (own.yy + 1 / 12) - 1)).toBeLessThan(5e-3);
  expect(Math.abs(mean((x, y) => (x - own.x) * (y - own.y)) / own.xy - 1)).toBeLessThan(5e-3);
  // One far narrower than a pixel is all in the pixel where it is.
  expect(sharesIn({ x: 0, y: 0, width, height }, [mode({ x: 5.4, y: 7.6, xx: 1e-4, yy: 1e-4 })])[7 * width + 5]).toBeCloseTo(1, 3);
  const [left, top] = [28, 20];
  const part = sharesIn({ x: left, y: top, width: 3, height: 2 }, [own]);
  part.forEach((share, at) => expect(share).toBe(shares[(top + Math.floor(at / 3)) * width + left + (at % 3)]));
});

test("a pyramid is drawn where its coefficients are, the brightest place white", async () => {
  const monitor = { name: "back", width_px: 64, height_px: 48 };
  // Green of the only pixel: two Gaussians of sigma 1 px, at columns 5 and 9 of row 3; the first is twice as bright.
  const place = 1024 * 5 + 3;
  const bytes = matteBytes({
    width: 1,
    height: 1,
    metadata: { monitors: [monitor], footprint: "pyramid" },
    suffixes: ["R", "G", "B"],
    modeCount: 1,
    foreground: () => 0,
    modes: (_, channel) => (channel === 1 ? [mode({ x: 15, y: 7, xx: 16 })] : []),
    pyramids: [[1, 1, 0, 0, 0.01, 0.02, 2, 0, 0, place, 1024 * 4, 0.5, 0.25]],
  });
  const drawn = footprintPicture(await readMatte(bytes, () => undefined, true), 0, 0)!;
  const green = (x: number, y: number): number =>
    drawn.picture.pixels[4 * ((y - drawn.box.y) * drawn.box.width + x - drawn.box.x) + 1]!;
  expect([green(10, 6), green(11, 7)]).toEqual([255, 255]); // the centre is the corner of four pixels
  expect(green(18, 6)).toBe(Math.round(255 * (1.055 * 0.5 ** (1 / 2.4) - 0.055)));
  expect(green(14, 6)).toBeLessThan(50);
  expect(drawn.picture.pixels[0]).toBe(0);
  expect(footprintPicture(await readMatte(bytes, () => undefined, true), 0, 1)).toBeUndefined();
});
