import { describe, expect, it } from "vitest";
import { shownWords, stimulusWords } from "../../src/session/stimulus_words";

// The words of each kind are those of core/pattern/describe_step.cpp; a solid has its colour too.
describe("stimulusWords", () => {
  it.each([
    [
      { kind: "gauss_stripe", panel: "back", phiDeg: 45, rPx: 120, sigmaPx: 8 },
      "back: stripe at 45 deg, r 120.0 px",
    ],
    [{ kind: "gauss_stripe", panel: "back", sigmaPx: 8 }, "back: stripe at 0 deg, r 0.0 px"],
    [
      { kind: "sinusoid", panel: "left", phiDeg: 90, periodPx: 64, phaseDeg: 270 },
      "left: sinusoid at 90 deg, period 64 px, phase 270 deg",
    ],
    [
      { kind: "square", panel: "back", orient: "vertical_bars", barWidthPx: 16, inverse: true },
      "back: vertical bars of 16 px, inverse",
    ],
    [
      { kind: "square", panel: "back", orient: "horizontal_bars", barWidthPx: 16 },
      "back: horizontal bars of 16 px",
    ],
    [{ kind: "solid", panel: "back" }, "back: solid white"],
    [{ kind: "solid", panel: "back", colour: [0, 0, 0] }, "back: solid black"],
    [{ kind: "solid", panel: "back", colour: [0, 0.5, 1] }, "back: solid 0, 0.5, 1"],
    [{ kind: "patch", panel: "back", patchId: 21845 }, "back: id patch alone"],
    [{ kind: "photo", panel: "back", name: "harbour" }, "back: photo harbour"],
    [{ kind: "ramp", panel: "back" }, "back: ramp"],
  ])("%j", (stimulus, words) => expect(stimulusWords(stimulus)).toBe(words));
});

it("names every monitor that was lit", () => {
  expect(
    shownWords({ stimulus: { kind: "ramp", panel: "back" }, alsoLit: [{ kind: "solid", panel: "left" }] }),
  ).toBe("back: ramp; left: solid white");
});
