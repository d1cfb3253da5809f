import { expect, it } from "vitest";
import { bytesText, nanosecondsText, plainName, secondsText } from "../../src/parts/words";
import { programOf, usualProgram } from "../../src/rig/programs";
import { preparationText } from "../../src/rig/preparation";
import { verdict } from "../../src/rig/doctor";

it("says figures in the unit that fits", () => {
  expect([0, 999, 1000, 80128, 42.6e9].map(bytesText)).toEqual(["0 B", "999 B", "1 kB", "80 kB", "43 GB"]);
  expect([0.04, 9.96, 59.6, 125, 7260].map(secondsText)).toEqual([
    "0.0 s",
    "10.0 s",
    "1 min 00 s",
    "2 min 05 s",
    "2 h 01 min",
  ]);
  expect([12, 1500, -2.5e6, 3e9].map(nanosecondsText)).toEqual(["12 ns", "1.5 µs", "-2.5 ms", "3 s"]);
  expect(plainName("SESSION_STATE_CAPTURING", "SESSION_STATE_")).toBe("capturing");
});

it("takes what most nodes run for the usual program", () => {
  const nodes = [
    { version: "1", build: "a" },
    { version: "1", build: "b" },
    { version: "1", build: "b" },
  ];
  expect(usualProgram(nodes)).toBe(programOf(nodes[1]!));
});

it("says what a camera prepares, and never that it is done before it is", () => {
  expect(preparationText({ what: "simulating the scene", done: 0.999 })).toBe("simulating the scene, 99 %");
  expect(preparationText({ what: "simulating the scene", done: 0 })).toBe("simulating the scene, 0 %");
  expect(preparationText({ what: "opening the camera" })).toBe("opening the camera");
});

it("sums findings up by the worst", () => {
  expect(verdict([{ level: "FINDING_LEVEL_OK" }])).toBe("No problems found.");
  expect(verdict([{ level: "FINDING_LEVEL_WARNING" }, { level: "FINDING_LEVEL_OK" }])).toContain(
    "one thing could be better",
  );
  expect(verdict([{ level: "FINDING_LEVEL_WARNING" }, { level: "FINDING_LEVEL_PROBLEM" }])).toContain(
    "would fail",
  );
});
