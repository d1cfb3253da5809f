import { describe, expect, it } from "vitest";
import { partsOf } from "../../src/parts/remedies";

/** The message with each offer as [label]. */
const offered = (message: string): string =>
  partsOf(message)
    .map(({ text, isCommand, call, place }) => (isCommand ? `[${call?.label ?? place?.label ?? text}]` : text))
    .join("");

describe("partsOf", () => {
  it("offers what the console can do in place of a command", () => {
    expect(offered("paused on request; resume with: glasswing resume vase.2")).toBe(
      "paused on request; resume with: [Resume vase.2]",
    );
    expect(offered("try them again: glasswing retry a-1.")).toBe("try them again: [Retry a-1].");
    expect(offered("solve it first: glasswing solve s --watch")).toBe("solve it first: [Solve s]");
    expect(offered('there is no session "x"; `glasswing sessions` lists them')).toBe(
      'there is no session "x"; [Sessions] lists them',
    );
    expect(offered("glasswing calibrate camera, or do without: glasswing calibrate forget back")).toBe(
      "[Calibrate the camera], or do without: [Forget the calibration of back]",
    );
    expect(offered("glasswing calibrate display --monitor left")).toBe("[Calibrate left]");
    expect(offered("see them all: glasswing fleet")).toBe("see them all: [Fleet]");
  });

  it("leaves other commands and other words as they are", () => {
    for (const text of [
      "start one: glasswing-solver --server HOST:PORT",
      "glasswing plan make --for-rig makes a plan that fits",
      "the glasswing of a rig",
      "",
    ])
      expect(offered(text)).toBe(text);
    expect(offered("`glasswing console token` makes one")).toBe("[glasswing console token] makes one");
  });

  it("takes words in capitals for no name", () => {
    expect(offered("hand it over: glasswing nodes release camera-2")).toBe("hand it over: [Release camera-2]");
    expect(offered("free others by: glasswing nodes release NAME")).toBe("free others by: [Rig]");
  });

  it("asks before something is lost, and only then", () => {
    const calls = (text: string) => partsOf(text).flatMap(({ call }) => call ?? []);
    for (const text of ["glasswing delete s", "glasswing nodes release n", "glasswing calibrate forget c"])
      expect(calls(text)[0]?.loss).toBeTruthy();
    for (const verb of ["resume", "retry", "cancel", "solve"])
      expect(calls(`glasswing ${verb} s`).map(({ loss }) => loss)).toEqual([undefined]);
  });

  it("loses no letter but backquotes", () => {
    const text = 'x glasswing y `glasswing nodes` z glasswing resume q; "glasswing fsck" `glasswing steps s` glasswing ';
    expect(
      partsOf(text)
        .map((part) => part.text)
        .join(""),
    ).toBe(text.replaceAll("`", ""));
  });
});
