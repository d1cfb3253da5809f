import { describe, expect, it } from "vitest";
import type { StepEventJson } from "../../src/gen/glasswing/v1/session_service_pb";
import { columnsOf, kStates, Timeline } from "../../src/session/timeline";

const shown = (step: number, seconds: number): StepEventJson => ({
  step,
  seconds,
  outcome: "STEP_OUTCOME_SHOWN",
});
const proven = (
  step: number,
  seconds: number,
  proof: StepEventJson["proof"] = "PROOF_TIME_AND_PATCH",
): StepEventJson => ({
  step,
  seconds,
  outcome: "STEP_OUTCOME_PROVEN",
  file: `frames/${step}.tif`,
  ...(proof && { proof }),
});
const retaken = (step: number, seconds: number, why: string): StepEventJson => ({
  step,
  seconds,
  outcome: "STEP_OUTCOME_RETAKEN",
  why,
});

function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

/** A capture in which each showing fails with the given probability. */
function capture(steps: number, failing: number, seed: number): StepEventJson[] {
  const next = random(seed);
  const events: StepEventJson[] = [];
  let seconds = 0;
  for (let pending = Array.from({ length: steps }, (_, step) => step); pending.length > 0;) {
    const again: number[] = [];
    for (const step of pending) {
      events.push(shown(step, (seconds += 1 / 30)));
      if (next() < failing) {
        events.push(retaken(step, seconds, next() < 0.5 ? "too late" : "another id"));
        again.push(step);
      } else {
        events.push(proven(step, seconds, next() < 0.5 ? "PROOF_TIME" : "PROOF_TIME_AND_PATCH"));
      }
    }
    pending = again;
  }
  return events;
}

const countOf = (timeline: Timeline, state: (typeof kStates)[number]): number =>
  timeline.counts[kStates.indexOf(state)]!;

describe("Timeline", () => {
  it("tells of each step the farthest that it came, in whatever pieces the events come", () => {
    const events = capture(2000, 0.3, 20261122);
    expect(events.length).toBeGreaterThan(5000);
    const whole = new Timeline(2000),
      pieces = new Timeline(2000);
    whole.add(events);
    for (let i = 0; i < events.length; i += 7) pieces.add(events.slice(i, i + 7));
    const byPatch = events.filter(({ proof }) => proof === "PROOF_TIME_AND_PATCH").length;
    const retakes = events.filter(({ outcome }) => outcome === "STEP_OUTCOME_RETAKEN");
    for (const timeline of [whole, pieces]) {
      expect(countOf(timeline, "patch")).toBe(byPatch);
      expect(countOf(timeline, "time")).toBe(2000 - byPatch);
      expect(timeline.retaken).toBe(retakes.length);
      expect(timeline.retakeCounts.reduce((sum, count) => sum + count)).toBe(retakes.length);
      expect([...timeline.reasons.values()].reduce((sum, count) => sum + count)).toBe(retakes.length);
      expect(timeline.retakes[0]).toMatchObject({ step: retakes.at(-1)!.step, why: retakes.at(-1)!.why });
      expect(timeline.events.steps.length).toBe(events.length);
      expect([...timeline.events.seconds]).toEqual(events.map(({ seconds }) => seconds));
      expect(timeline.provenAt.length).toBe(2000);
    }
  });

  it("has every step in exactly one state at any moment", () => {
    const timeline = new Timeline(50);
    for (const event of capture(50, 0.4, 7)) {
      timeline.add([event]);
      expect(timeline.counts.reduce((sum, count) => sum + count)).toBe(50);
      kStates.forEach((_, state) =>
        expect(timeline.states.filter((each) => each === state).length).toBe(timeline.counts[state]),
      );
    }
  });

  it("does not take a proof back when its step is shown again", () => {
    const timeline = new Timeline(2);
    timeline.add([shown(0, 1), proven(0, 2), shown(0, 3)]);
    expect(countOf(timeline, "patch")).toBe(1);
    expect(countOf(timeline, "shown")).toBe(0);
  });

  it("takes a step 0 and a time 0 that JSON leaves out, and passes over steps that the plan does not have", () => {
    const timeline = new Timeline(1);
    timeline.add([{ outcome: "STEP_OUTCOME_PROVEN", proof: "PROOF_TIME" }, proven(1, 1), proven(-1, 1)]);
    expect(countOf(timeline, "time")).toBe(1);
    expect(timeline.events.steps.length).toBe(1);
  });
});

describe("columnsOf", () => {
  it("shows each step by itself where there is room", () => {
    const timeline = new Timeline(3);
    timeline.add([proven(0, 1), shown(1, 1), retaken(1, 1, "x")]);
    const { states, retaken: again } = columnsOf(timeline, 3);
    expect([...states].map((state) => kStates[state])).toEqual(["patch", "shown", "planned"]);
    expect([...again]).toEqual([0, 1, 0]);
  });

  it("shows a column as proven only if all of its steps are", () => {
    const timeline = new Timeline(1000);
    timeline.add(
      Array.from({ length: 1000 }, (_, step) => step)
        .filter((step) => step !== 437)
        .map((step) => proven(step, step)),
    );
    const { states } = columnsOf(timeline, 100);
    expect([...states].map((state, i) => [kStates[state], i]).filter(([state]) => state !== "patch")).toEqual(
      [["planned", 43]],
    );
  });
});
