import { describe, expect, it } from "vitest";
import { namedCameras, withCameras } from "../../src/session/cameras";

const kUp = ["left", "right", "top"];

describe("withCameras", () => {
  it("takes all that are up", () => {
    expect(withCameras({ method: "gaussian" }, kUp)).toEqual({ method: "gaussian", cameras: kUp });
  });
  it("takes those that are ticked, whatever the plan names", () => {
    const plan = { method: "gaussian", camera: "top" };
    expect(withCameras(plan, kUp, new Set(["right", "left"]))).toEqual({ method: "gaussian", cameras: ["left", "right"] });
  });
  it("makes a session of one camera where one is ticked", () => {
    expect(withCameras({ cameras: ["left", "right"] }, kUp, new Set(["right"]))).toEqual({ camera: "right" });
  });
  it("leaves a plan alone that names its cameras, or on a rig with one", () => {
    for (const plan of [{ camera: "top" }, { cameras: ["left", "top"] }]) expect(withCameras(plan, kUp)).toEqual(plan);
    expect(withCameras({ method: "alpha" }, ["left"])).toEqual({ method: "alpha" });
    expect(withCameras({ method: "alpha" }, [])).toEqual({ method: "alpha" });
  });
  it("measures one camera in a calibration", () => {
    expect(withCameras({ calibration: {} }, kUp)).toEqual({ calibration: {}, camera: "left" });
  });
});

it("names a plan's cameras", () => {
  expect([{}, { camera: "top" }, { cameras: ["left", "top"] }].map(namedCameras)).toEqual([[], ["top"], ["left", "top"]]);
});
