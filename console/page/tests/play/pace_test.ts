import { expect, test } from "vitest";
import { Pace } from "../../src/play/pace";

test("what is quick is drawn whole, what is slow as coarsely as it must be", () => {
  const pace = new Pace(1280);
  expect(pace.step).toBe(1);
  for (const [whole_ms, step] of [
    [16, 1],
    [60, 1],
    [100, 2],
    [800, 4],
    [3000, 8],
    [60_000, 8],
    [20, 1],
  ] as const) {
    pace.took(1, whole_ms);
    expect(pace.step).toBe(step);
  }
});

test("a coarse picture makes the next coarser, never finer", () => {
  const pace = new Pace(1280);
  pace.took(1, 100);
  pace.took(2, 16);
  expect(pace.step).toBe(2);
  pace.took(2, 500);
  expect(pace.step).toBe(8);
});

test("a small picture stays large enough to be seen", () => {
  for (const [side_px, step] of [
    [128, 1],
    [319, 1],
    [320, 2],
    [1279, 4],
  ] as const) {
    const pace = new Pace(side_px);
    pace.took(1, 1e6);
    expect(pace.step).toBe(step);
  }
});
