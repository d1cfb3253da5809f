import { describe, expect, it } from "vitest";
import {
  drawPeaking,
  drawZebra,
  histogram,
  kClipped,
  kSharp,
  slopes,
  type Pixels,
} from "../../src/rig/picture_figures";

function picture(
  width: number,
  height: number,
  colour: (x: number, y: number) => [number, number, number],
): Pixels {
  const data = new Uint8ClampedArray(4 * width * height);
  for (let y = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x) data.set([...colour(x, y), 255], 4 * (y * width + x));
  }
  return { data, width, height };
}
const gray = (code: number): [number, number, number] => [code, code, code];

it("counts every pixel of every colour once", () => {
  const counts = histogram(picture(16, 16, (x, y) => [16 * y + x, 7, x < 8 ? 0 : 255]));
  expect([...counts.subarray(0, 256)]).toEqual(new Array(256).fill(1));
  expect(counts[256 + 7]).toBe(256);
  expect([counts[512], counts[512 + 255]]).toEqual([128, 128]);
  expect(counts.reduce((sum, count) => sum + count)).toBe(3 * 256);
});

describe("slopes", () => {
  it("are a plane's, whatever its direction", () => {
    for (const [right, down] of [
      [3, 0],
      [0, -2],
      [2, 1],
    ] as const) {
      const { width, height } = { width: 12, height: 9 };
      const found = slopes(picture(width, height, (x, y) => gray(60 + right * x + down * y)));
      for (let y = 1; y < height - 1; ++y) {
        for (let x = 1; x < width - 1; ++x)
          expect(found[y * width + x]).toBeCloseTo(Math.hypot(right, down), 3);
      }
    }
  });

  it("are half of an edge's height on both sides of it, and nothing elsewhere", () => {
    const found = slopes(picture(10, 5, (x) => gray(x < 5 ? 20 : 140)));
    const row = [...found.subarray(20, 30)].map((slope) => Math.round(1000 * slope) / 1000);
    expect(row).toEqual([0, 0, 0, 0, 60, 60, 0, 0, 0, 0]);
  });
});

it("marks an edge that is sharp, and not the same edge out of focus", () => {
  const marked = (blur: number): number => {
    const edge = picture(64, 8, (x) =>
      gray(Math.round(200 * Math.min(1, Math.max(0, (x - 32) / blur + 0.5)))),
    );
    const before = edge.data.slice();
    drawPeaking(edge);
    return edge.data.filter((value, i) => value !== before[i]).length;
  };
  expect(200 / 2).toBeGreaterThan(kSharp);
  expect(marked(0.01)).toBeGreaterThan(0);
  expect(200 / 20).toBeLessThan(kSharp);
  expect(marked(20)).toBe(0);
});

it("draws stripes over what is clipped in any colour, and over nothing else", () => {
  const half = picture(32, 32, (x) =>
    x < 16 ? [kClipped - 1, kClipped - 1, kClipped - 1] : [0, kClipped, 0],
  );
  const before = half.data.slice();
  drawZebra(half);
  const changed = new Set<number>();
  half.data.forEach((value, i) => value !== before[i] && changed.add((i >> 2) % 32));
  expect([...changed].sort((a, b) => a - b)).toEqual(Array.from({ length: 16 }, (_, i) => 16 + i));
});
