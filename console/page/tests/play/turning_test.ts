import { describe, expect, it } from "vitest";
import { byKey } from "../../src/play/turning";

const first = { turn_deg: 10, gain: 0.5 };
const key = (name: string, shiftKey = false) => byKey({ key: name, shiftKey }, { turn_deg: 90, gain: 2 }, first);

describe("keys", () => {
  it("turn what lies ahead to their side", () => {
    expect(key("ArrowRight")).toEqual({ turn_deg: 93, gain: 2 });
    expect(key("ArrowLeft", true)).toEqual({ turn_deg: 75, gain: 2 });
  });
  it("change light by a quarter of a stop", () => {
    expect(key("+")!.gain).toBeCloseTo(2 ** 1.25);
    expect(key("-")!.gain).toBeCloseTo(2 ** 0.75);
  });
  it("put it back, and leave others alone", () => {
    expect(key("0")).toEqual(first);
    expect(key("ArrowUp")).toBeUndefined();
  });
});
