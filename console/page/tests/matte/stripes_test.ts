import { expect, test } from "vitest";
import type { Mode } from "../../src/light/matte";
import { foretold, sweepsOf } from "../../src/matte/stripes";

const mode: Mode = { weight: 0.7, x: 31, y: 22, xx: 9, xy: 4, yy: 5, texture: 0, weight_sd: 0, centre_sd: 0 };

test("a stripe through a footprint is their product's integral", () => {
  const determinant = mode.xx * mode.yy - mode.xy ** 2;
  const footprint = (x: number, y: number): number => {
    const [u, v] = [x - mode.x, y - mode.y];
    const square = (mode.yy * u * u - 2 * mode.xy * u * v + mode.xx * v * v) / determinant;
    return Math.exp(-0.5 * square) / (2 * Math.PI * Math.sqrt(determinant));
  };
  for (const phiDeg of [0, 90, 45, -45, 17]) {
    const stripe = { kind: "gauss_stripe", phiDeg, sigmaPx: 2.5, peak: 0.8 };
    const [nx, ny] = [Math.cos((phiDeg * Math.PI) / 180), Math.sin((phiDeg * Math.PI) / 180)];
    for (const r of [nx * mode.x + ny * mode.y, nx * mode.x + ny * mode.y + 4]) {
      const step = 0.25;
      let sum = 0;
      for (let x = mode.x - 25; x < mode.x + 25; x += step) {
        for (let y = mode.y - 25; y < mode.y + 25; y += step)
          sum +=
            footprint(x, y) * 0.8 * Math.exp((-0.5 * (nx * x + ny * y - r) ** 2) / 2.5 ** 2) * step * step;
      }
      // With steps far below its width, a Gaussian's sum is its integral.
      expect(foretold([mode], 0.05, stripe, 0, r, 1)).toBeCloseTo(0.05 + 0.7 * sum, 9);
      expect(foretold([mode], 0.05, stripe, 1, r, 1)).toBe(0.05);
    }
  }
});

test("samples are grouped by direction, in the stripe's order", () => {
  const frame = (file: string, object: boolean, phiDeg: number, rPx: number) => ({
    file,
    object,
    exposureMs: 4,
    stimulus: { kind: "gauss_stripe", panel: "left", phiDeg, rPx, sigmaPx: 2, peak: 1 },
  });
  const manifest = {
    monitors: [{ name: "back" }, { name: "left" }],
    frames: [
      frame("a", true, 0, 5),
      frame("b", true, 0, 1),
      frame("c", true, 90, 1),
      frame("d", false, 0, 2),
      { file: "e", object: true, exposureMs: 4, stimulus: { kind: "solid" } },
    ],
  };
  const samples = ["a", "b", "c", "d", "e"].map((file, i) => ({ file, radiance: [i, i, i] }));
  const sweeps = sweepsOf(manifest, samples);
  expect(sweeps.map(({ title, texture, points }) => [title, texture, points.map(({ r }) => r)])).toEqual([
    ["left at 0°", 1, [1, 5]],
    ["left at 90°", 1, [1]],
  ]);
});
