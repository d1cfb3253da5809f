import { describe, expect, it } from "vitest";
import { framesBySteps, newestOf, placeOfStep, showpieceOf } from "../../src/session/frames";

const frame = (step: number, at: number) => ({ file: `frames/${at}.tif`, step, exposureStartNs: String(at) });

describe("frames", () => {
  it("stand by their steps, whenever they were taken", () => {
    const frames = framesBySteps({ frames: [frame(2, 10), frame(0, 20), frame(1, 30)] });
    expect(frames.map(({ step }) => step)).toEqual([0, 1, 2]);
    expect(newestOf(frames)).toBe(1);
    expect([0, 1, 2, 3].map((step) => placeOfStep(frames, step))).toEqual([0, 1, 2, 2]);
  });

  it("without steps stay as they are, after the others", () => {
    const frames = framesBySteps({ frames: [frame(-1, 1), frame(-1, 2), frame(5, 3)] });
    expect(frames.map(({ file }) => file)).toEqual(["frames/3.tif", "frames/1.tif", "frames/2.tif"]);
  });

  it("a step that is not kept stands where it would", () => {
    expect(placeOfStep([frame(0, 1), frame(4, 2)], 2)).toBe(1);
  });
});

describe("what is looked at first", () => {
  const solid = (object: boolean, colour?: number[]) => ({
    object,
    stimulus: { kind: "solid", ...(colour && { colour }) },
  });
  it("is the object before light, else the newest frame", () => {
    expect(showpieceOf([solid(false), solid(true, [0, 0, 0]), solid(true), solid(true, [1, 0, 0])])).toBe(2);
    expect(showpieceOf([solid(false), solid(false)])).toBe(1);
  });
});
