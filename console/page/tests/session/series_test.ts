import { describe, expect, it } from "vitest";
import type { SessionJson } from "../../src/gen/glasswing/v1/session_pb";
import { placeOf, posesOf, seriesOf, stateOfPose } from "../../src/session/series";

function pose(position: number, more: SessionJson = {}): SessionJson {
  return {
    name: `vase-${String(position).padStart(3, "0")}`,
    note: `turn at ${position} deg, pose ${position / 10 + 1} of 36`,
    tags: ["glass", "vase"],
    axes: { turn: position },
    state: "SESSION_STATE_DONE",
    stepCount: 5,
    provenCount: 5,
    ...more,
  };
}

describe("seriesOf", () => {
  it("reads the note and the tag that the name begins with", () => {
    expect(seriesOf(pose(10))).toEqual({ name: "vase", axis: "turn", count: 36 });
    expect(seriesOf(pose(10, { note: "chipped; turn at 10 deg, pose 2 of 36" }))?.count).toBe(36);
  });
  it("finds none for other sessions", () => {
    expect(seriesOf(pose(10, { note: "" }))).toBeUndefined();
    expect(seriesOf(pose(10, { tags: ["glass"] }))).toBeUndefined();
    expect(seriesOf(pose(10, { note: "lift at 10 mm, pose 2 of 3" }))).toBeUndefined();
    expect(seriesOf({ name: "vase" })).toBeUndefined();
  });
});

describe("posesOf", () => {
  it("tells captured, running and flagged poses apart, in the order of their angles", () => {
    const sessions = [
      pose(100, { state: "SESSION_STATE_CAPTURING", provenCount: 2 }),
      pose(20, { state: "SESSION_STATE_FAILED", provenCount: 2 }),
      pose(0),
      pose(10, { rigChanges: [{ what: "the camera moved" }] }),
      pose(30, { state: "SESSION_STATE_CAPTURED" }),
      pose(40, { state: "SESSION_STATE_SOLVING" }),
      pose(50, { state: "SESSION_STATE_PAUSED", provenCount: 1 }),
      { name: "vase-note", tags: ["vase"] },
    ];
    const series = { name: "vase", axis: "turn", count: 36 };
    expect(posesOf(series, sessions).map(({ position_deg, state }) => [position_deg, state])).toEqual([
      [0, "captured"],
      [10, "flagged"],
      [20, "flagged"],
      [30, "captured"],
      [40, "captured"],
      [50, "flagged"],
      [100, "running"],
    ]);
  });
});

describe("placeOf", () => {
  it("puts 0 before the camera, which is below, and turns clockwise from there", () => {
    expect(placeOf(0, 10).x).toBeCloseTo(0);
    expect(placeOf(0, 10).y).toBeCloseTo(10);
    expect(placeOf(90, 10).x).toBeCloseTo(-10);
    expect(placeOf(180, 10).y).toBeCloseTo(-10);
  });
});

describe("stateOfPose", () => {
  it("flags a cancelled capture", () => {
    expect(stateOfPose(pose(0, { state: "SESSION_STATE_CANCELLED" }))).toBe("flagged");
  });
});
