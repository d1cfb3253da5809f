import { expect, test } from "vitest";
import { pointsOf } from "../../src/rig/curves";

const pairs = (line: number[]): number[][] => pointsOf(line).split(" ").map((point) => point.split(",").map(Number));

test("a curve begins and ends at the first and last code, however long it is", () => {
  for (const length of [2, 99, 100, 101, 256, 4096]) {
    const points = pairs(Array.from({ length }, (_, k) => k / (length - 1)));
    expect(points.length).toBe(Math.min(100, length));
    expect(points[0]).toEqual([34, 108]);
    expect(points.at(-1)).toEqual([214, 6]);
  }
});

test("light beyond full scale and below black stays in the chart", () => {
  expect(pairs([-0.2, 0.5, 1.5]).map(([, y]) => y)).toEqual([108, 57, 6]);
});
