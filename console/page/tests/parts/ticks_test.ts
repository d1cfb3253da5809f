import { describe, expect, it } from "vitest";
import { rangeOf, stepOf, ticksTo, timeStepOf, timeTickText } from "../../src/parts/ticks";

const kSpans = [0.3, 1, 7.5, 59, 61, 224, 3599, 12345, 1e6];

describe("steps of an axis", () => {
  it("leave at most so many ticks, and no fewer than a fifth of them beyond the smallest step", () => {
    for (const span of kSpans) {
      for (const max of [4, 6]) {
        for (const step of [stepOf(span, max), timeStepOf(span, max)]) {
          expect(span / step).toBeLessThanOrEqual(max);
          if (step > 1) expect(span / step).toBeGreaterThan(max / 3);
        }
      }
    }
  });
  it("are round in what the axis counts", () => {
    expect([7.5, 24, 224, 1024].map((span) => stepOf(span, 5))).toEqual([2, 5, 50, 500]);
    expect([7.5, 90, 200, 5000, 1e5].map((span) => timeStepOf(span, 5))).toEqual([2, 20, 60, 1200, 36000]);
  });
});

it("an axis has room around its values, and none below 0 that nothing reaches", () => {
  expect(rangeOf(null, null)).toEqual([0, 1]);
  expect(rangeOf(0, 0)).toEqual([0, 1]);
  expect(rangeOf(0.5, 10.5)).toEqual([0, 11.5]);
  expect(rangeOf(2, 12)).toEqual([1, 13]);
  expect(rangeOf(5, 5)).toEqual([0, 10]);
  expect(rangeOf(-3, -3)).toEqual([-6, 0]);
  expect(rangeOf(-1, 9)).toEqual([-2, 10]);
});

it("ticks begin at 0 and end before the last", () => {
  expect(ticksTo(224, 100)).toEqual([0, 100, 200]);
  expect(ticksTo(0.3, 1)).toEqual([0]);
});

it("times of ticks have no more digits than they need", () => {
  expect([0, 20, 120, 90, 36000].map(timeTickText)).toEqual(["0 s", "20 s", "2 min", "1 min 30 s", "10 h 00 min"]);
});
