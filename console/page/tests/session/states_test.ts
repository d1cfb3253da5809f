import { describe, expect, it } from "vitest";
import { allows, kStateNames, waitingText } from "../../src/session/states";

describe("allows", () => {
  it("follows the server's list, whatever the state", () => {
    for (const state of kStateNames as NonNullable<Parameters<typeof allows>[0]["state"]>[]) {
      expect(allows({ state }, "SESSION_ACTION_DELETE")).toBe(false);
      expect(allows({ state, allowedActions: ["SESSION_ACTION_DELETE"] }, "SESSION_ACTION_DELETE")).toBe(true);
      expect(allows({ state, allowedActions: ["SESSION_ACTION_DELETE"] }, "SESSION_ACTION_SOLVE")).toBe(false);
    }
  });
});

describe("waitingText", () => {
  it("tells what, since when, and what to do", () => {
    const since = new Date();
    since.setHours(12, 5, 0, 0);
    const waiting = { what: "no solver is running", since: since.toISOString(), advice: "start one" };
    expect(waitingText(waiting)).toMatch(/^Waiting: no solver is running, since .*05.*; start one$/);
    expect(waitingText({ ...waiting, since: "" })).toBe("Waiting: no solver is running; start one");
  });
});
