import { expect, test } from "vitest";
import { withOffset, type History } from "../../src/rig/clock_history";

test("a clock's history grows by new measurements only, from its first one, and is bounded", () => {
  const now = 10_000;
  let history: History | undefined;
  // The server's: one each ten seconds; ages in whole seconds are exact.
  for (let age = 3600; age > 0; age -= 10)
    history = withOffset(history, { offsetNs: String(5e9 - age), boundNs: "40", ageS: age }, now);
  expect(history!.time.length).toBe(360);
  expect(history!.first_ns).toBe(5e9 - 3600);
  expect([history!.time[0], history!.offset[0], history!.above[0], history!.below[0]]).toEqual([6400, 0, 40, -40]);
  history = withOffset(history, { offsetNs: "5000000000", ageS: 10 }, now); // known
  expect(history.time.length).toBe(360);
  for (let second = 1; second <= 800; ++second)
    history = withOffset(history, { offsetNs: String(5e9 + second), ageS: 0 }, now + second);
  expect(history.time.length).toBe(900);
  expect(history.time.at(-1)).toBe(10_800);
  expect(history.offset.at(-1)).toBe(4400);
});
