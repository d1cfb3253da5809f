import { describe, expect, it } from "vitest";
import { allows, kStateNames } from "../../src/session/states";

describe("allows", () => {
  it("follows the server's list, whatever the state", () => {
    for (const state of kStateNames as NonNullable<Parameters<typeof allows>[0]["state"]>[]) {
      expect(allows({ state }, "SESSION_ACTION_DELETE")).toBe(false);
      expect(allows({ state, allowedActions: ["SESSION_ACTION_DELETE"] }, "SESSION_ACTION_DELETE")).toBe(true);
      expect(allows({ state, allowedActions: ["SESSION_ACTION_DELETE"] }, "SESSION_ACTION_SOLVE")).toBe(false);
    }
  });
});
