import { describe, expect, it } from "vitest";
import { fitsOf, fitText, kPlanNames, kPurposes } from "../../src/session/ready_plans";

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
      "a",
      "b (2 warnings)",
      "c (not for this rig)",
      "d",
    ]);
    expect(fitText(new Map([["quick", 1]]), "quick")).toBe(`quick: ${kPurposes["quick"]} (1 warning)`);
  });
});

it("says of each plan what it is for", () => {
  expect(kPlanNames.toSorted()).toEqual(Object.keys(kPurposes).toSorted());
});
