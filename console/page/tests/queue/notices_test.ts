import { expect, test } from "vitest";
import type { QueueItemJson } from "../../src/gen/glasswing/v1/queue_service_pb";
import { notices } from "../../src/queue/notices";

const kRunning: QueueItemJson = { number: "1", session: "vase", state: "QUEUE_ITEM_STATE_RUNNING" };
const kDone: QueueItemJson = { ...kRunning, state: "QUEUE_ITEM_STATE_DONE", ended: "2026-11-01T12:00:00Z" };
const kNext: QueueItemJson = { number: "2", state: "QUEUE_ITEM_STATE_WAITING" };

test("a notice tells of what is new and needs a person", () => {
  const waits: QueueItemJson = { ...kNext, waitsSince: "2026-11-01T12:00:00Z", reason: "waits for an approval" };
  expect(notices([kRunning, kNext], [kRunning, waits])).toEqual(["item 2: waits for an approval"]);
  expect(notices([kRunning, waits], [kRunning, waits])).toEqual([]);
  expect(notices([kRunning], [kRunning, waits])).toEqual([]); // added just now, and listed on the page
});

test("of items that ended, those that failed or are unusual are told, and the end of all", () => {
  expect(notices([kRunning, kNext], [kDone, kNext])).toEqual([]);
  expect(notices([kRunning, kNext], [{ ...kDone, reason: "unusual: 9 % flagged" }, kNext])).toEqual(["vase: unusual: 9 % flagged"]);
  expect(notices([kRunning], [kDone])).toEqual(["The queue is done."]);
  expect(notices([kRunning], [])).toEqual(["The queue is done."]); // what has ended is not listed
  expect(notices([kDone], [kDone])).toEqual([]);
});
