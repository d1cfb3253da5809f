import { describe, expect, it } from "vitest";
import { recentRate, secondsLeft, stepLimit } from "../../src/session/rates";

describe("recentRate", () => {
  it("is that of evenly spaced steps, however many are proven at once", () => {
    for (const atOnce of [1, 4, 16]) {
      const times = Float64Array.from(
        { length: 960 },
        (_, i) => (Math.floor(i / atOnce) + 1) * (atOnce / 32),
      );
      for (let proven = atOnce; proven <= 960; proven += atOnce)
        expect(recentRate(times.subarray(0, proven), times[proven - 1]!)).toBe(
          proven < 32 + atOnce ? undefined : 32,
        );
    }
  });

  it("leaves out the time before the first proof, in which the rig starts", () => {
    const times = Float64Array.from({ length: 64 }, (_, i) => 4 + i / 32);
    expect(recentRate(times.subarray(0, 17), 4.5)).toBeUndefined();
    expect(recentRate(times.subarray(0, 49), 5.5)).toBe(32);
  });

  it("looks at the last seconds alone", () => {
    const times = Float64Array.from({ length: 200 }, (_, i) => (i < 100 ? i / 100 : 1 + (i - 99) / 10));
    expect(recentRate(times, 11)).toBeCloseTo(10, 9);
  });

  it("counts the time since the last proof, until it is a standstill", () => {
    const times = Float64Array.from({ length: 100 }, (_, i) => (i + 1) / 10);
    expect(recentRate(times, 12.5)).toBeCloseTo(5, 9);
    expect(recentRate(times, 240)).toBe(0);
    expect(recentRate(times, 0)).toBeCloseTo(10, 9); // proofs come before the session that tells the time
  });

  it("says nothing of nothing", () => expect(recentRate(new Float64Array(), 7)).toBeUndefined());
});

describe("stepLimit", () => {
  const monitors = [
    { name: "back", refreshHz: 60 },
    { name: "left", refreshHz: 144 },
  ];
  it("is the refresh rate of the slowest of the plan's monitors over the refreshes of a step", () => {
    expect(stepLimit({ holdRefreshes: 3 }, monitors)).toBe(20);
    expect(stepLimit({ holdRefreshes: 3, monitors: [{ name: "left" }] }, monitors)).toBe(48);
  });
  it("takes the plan's default of two refreshes", () => {
    expect(stepLimit({}, monitors)).toBe(30);
  });
  it("is not known without a monitor", () => {
    expect(stepLimit({}, [])).toBeUndefined();
  });
});

it("tells the time left only while something moves", () => {
  expect(secondsLeft(90, 30)).toBe(3);
  expect(secondsLeft(90, undefined)).toBeUndefined();
  expect(secondsLeft(90, 0)).toBeUndefined();
});
