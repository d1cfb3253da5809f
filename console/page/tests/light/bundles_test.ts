import { describe, expect, it } from "vitest";
import { bundleOf } from "../../src/light/bundles";
import type { Mode } from "../../src/light/matte";

const kSide_px = 3600;
const mode = (texture: number, x: number, y: number, xx: number, xy: number, yy: number): Mode => ({
  weight: 1,
  x,
  y,
  xx,
  xy,
  yy,
  texture,
  weight_sd: 0,
  centre_sd: 0,
});

// docs/rays.md: x right, y down, z ahead; docs/web.md: the faces.
const kMiddles = [
  [1, 0, 0],
  [-1, 0, 0],
  [0, 1, 0],
  [0, -1, 0],
  [0, 0, 1],
  [0, 0, -1],
];

/** The direction to a place of a face, written out face by face. */
function toPlace(face: number, x_px: number, y_px: number): number[] {
  const [a, b, sign] = [(2 * x_px) / kSide_px - 1, (2 * y_px) / kSide_px - 1, face % 2 === 0 ? 1 : -1];
  const at = face < 2 ? [sign, a, b] : face < 4 ? [b, sign, a] : [a, b, sign];
  const far = Math.hypot(...at);
  return at.map((each) => each / far);
}

const dot = (a: number[], b: number[]): number => a.reduce((sum, each, i) => sum + each * b[i]!, 0);

describe("bundles", () => {
  it("lead to the middles of the faces", () => {
    kMiddles.forEach((middle, face) => {
      const { direction } = bundleOf(mode(face, 1800, 1800, 1, 0, 1), kSide_px);
      direction.forEach((each, i) => expect(each).toBeCloseTo(middle[i]!, 12));
    });
  });

  it("have the covariance of directions through the footprint", () => {
    for (let face = 0; face < 6; ++face) {
      const [x, y, xx, xy, yy] = [1300, 2900, 40, -12, 9] as const;
      const { direction, ...covariance } = bundleOf(mode(face, x, y, xx, xy, yy), kSide_px);
      // Two pixels whose squares sum to the covariance: its Cholesky factors.
      const [first, second] = [
        [Math.sqrt(xx), xy / Math.sqrt(xx)],
        [0, Math.sqrt(yy - (xy * xy) / xx)],
      ] as const;
      const flat = Math.hypot(direction[0], direction[2]);
      const e1 = [direction[2] / flat, 0, -direction[0] / flat];
      const down = [-direction[1] * direction[0], 1 - direction[1] ** 2, -direction[1] * direction[2]];
      const e2 = down.map((each) => each / flat);
      const sums = { xx: 0, xy: 0, yy: 0 };
      for (const [dx, dy] of [first, second]) {
        const scale = 1e-3;
        const moved = toPlace(face, x + scale * dx!, y + scale * dy!).map((each, i) => (each - direction[i]!) / scale);
        const [u, v] = [dot(moved, e1), dot(moved, e2)];
        sums.xx += u * u;
        sums.xy += u * v;
        sums.yy += v * v;
      }
      for (const each of ["xx", "xy", "yy"] as const)
        expect(Math.abs(covariance[each] - sums[each])).toBeLessThan(1e-5 * (sums.xx + sums.yy));
    }
  });

  it("have one straight up, where there is no horizontal", () => {
    const { direction, xx, yy } = bundleOf(mode(3, 1800, 1800, 4, 0, 1), kSide_px);
    expect(direction).toEqual([0, -1, 0]);
    // The face's x is z, its y is x; e1 is x.
    expect(xx).toBeCloseTo(1 / 1800 ** 2, 15);
    expect(yy).toBeCloseTo(4 / 1800 ** 2, 15);
  });
});
