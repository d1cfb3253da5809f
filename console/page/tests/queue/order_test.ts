import { expect, test } from "vitest";
import type { QueueItemJson } from "../../src/gen/glasswing/v1/queue_service_pb";
import { placeBeside, placeOf } from "../../src/queue/order";

const kItems: QueueItemJson[] = [
  { number: "1", state: "QUEUE_ITEM_STATE_RUNNING" },
  { number: "2", state: "QUEUE_ITEM_STATE_WAITING" },
  { number: "3", state: "QUEUE_ITEM_STATE_WAITING" },
  { number: "4", state: "QUEUE_ITEM_STATE_WAITING" },
];

/** What the server makes of it. */
function moved(number: string, before: string | undefined): string {
  const numbers = kItems.map((item) => item.number!);
  if (before === undefined) return numbers.join("");
  const rest = numbers.filter((each) => each !== number);
  rest.splice(before === "0" ? rest.length : rest.indexOf(before), 0, number);
  return rest.join("");
}

test("an item takes the place of the one on which it is dropped", () => {
  expect(moved("4", placeOf(kItems, "4", "2"))).toBe("1423");
  expect(moved("2", placeOf(kItems, "2", "3"))).toBe("1324");
  expect(moved("2", placeOf(kItems, "2", "4"))).toBe("1342");
  expect(placeOf(kItems, "3", "3")).toBeUndefined();
});

test("only what waits moves, among what waits", () => {
  expect(placeOf(kItems, "1", "3")).toBeUndefined();
  expect(placeOf(kItems, "3", "1")).toBeUndefined();
  expect(placeBeside(kItems, "2", -1)).toBeUndefined();
  expect(placeBeside(kItems, "4", 1)).toBeUndefined();
  expect(moved("3", placeBeside(kItems, "3", -1))).toBe("1324");
  expect(moved("3", placeBeside(kItems, "3", 1))).toBe("1243");
});
