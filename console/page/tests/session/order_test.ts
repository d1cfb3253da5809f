import { describe, expect, it } from "vitest";
import { clicked, kColumns, kNewestFirst, ordered, startOfDay } from "../../src/session/order";

const kSessions = [
  { name: "vase-10", state: "SESSION_STATE_DONE", created: "2026-03-01T10:00:00Z", archiveBytes: "900", stepCount: 5 },
  { name: "vase-9", state: "SESSION_STATE_FAILED", created: "2026-03-02T09:00:00+02:00", archiveBytes: "1000" },
  { name: "Bowl", state: "SESSION_STATE_CAPTURING", created: "2026-03-02T08:00:00+02:00" },
] as const;
const names = (...order: Parameters<typeof clicked>): (string | undefined)[] =>
  ordered(kSessions, clicked(...order)).map(({ name }) => name);

describe("ordered", () => {
  it("compares numbers as numbers, and times as times", () => {
    expect(ordered(kSessions, kNewestFirst).map(({ name }) => name)).toEqual(["vase-9", "Bowl", "vase-10"]);
    expect(names(kNewestFirst, "name")).toEqual(["Bowl", "vase-9", "vase-10"]);
    expect(names(kNewestFirst, "size")).toEqual(["vase-9", "vase-10", "Bowl"]);
    expect(names(kNewestFirst, "state")).toEqual(["Bowl", "vase-10", "vase-9"]);
  });
  it("keeps every session, and turns with a second click", () => {
    for (const column of kColumns) {
      const once = clicked({ column: column === "name" ? "begun" : "name", descending: false }, column);
      const twice = clicked(once, column);
      expect(twice).toEqual({ column, descending: !once.descending });
      expect(new Set(ordered(kSessions, twice))).toEqual(new Set(kSessions));
    }
  });
});

it("a day begins at local midnight", () => {
  const now = new Date(2026, 2, 3, 14, 30);
  expect(startOfDay(0, now)).toBe(new Date(2026, 2, 3).toISOString());
  expect(startOfDay(3, now)).toBe(new Date(2026, 1, 28).toISOString());
});
