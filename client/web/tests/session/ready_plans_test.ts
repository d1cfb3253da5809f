import { describe, expect, it } from "vitest";
import { bestPlan, fitsOf, fitText, kFirstPlan, kPlanNames } from "../../src/session/ready_plans";

describe("bestPlan", () => {
  it("has the fewest warnings, and comes first among equals", () => {
    const fits = new Map([
      ["a", 2],
      ["b", undefined],
      ["c", 1],
      ["d", 1],
    ]);
    expect(bestPlan(fits)).toBe("c");
    expect(bestPlan(new Map([["b", undefined]]))).toBeUndefined();
    expect(bestPlan(new Map())).toBeUndefined();
  });
});

describe("fitsOf", () => {
  it("counts the warnings that not every plan has", () => {
    const warnings = new Map([
      ["a", ["the clock drifts", "the bars are coarse"]],
      ["b", ["the clock drifts"]],
      ["c", undefined],
    ]);
    expect([...fitsOf(warnings)]).toEqual([
      ["a", 1],
      ["b", 0],
      ["c", undefined],
    ]);
    expect([...fitsOf(new Map([["c", undefined]]))]).toEqual([["c", undefined]]);
  });
});

describe("fitText", () => {
  it("says how a plan fits, once that is known", () => {
    const fits = new Map([
      ["a", 0],
      ["b", 2],
      ["c", undefined],
    ]);
    expect(["a", "b", "c", "d"].map((name) => fitText(fits, name))).toEqual([
      "a: fits this rig",
      "b: 2 warnings",
      "c: not for this rig",
      "d",
    ]);
  });
});

it("the first plan is the one to begin with", () => {
  expect(kPlanNames[0]).toBe(kFirstPlan);
  expect(new Set(kPlanNames).size).toBe(kPlanNames.length);
});
