// The order of the queue's items, as a person changes it.
import type { QueueItemJson } from "../gen/glasswing/v1/queue_service_pb";

export function waits({ state }: QueueItemJson): boolean {
  return state === "QUEUE_ITEM_STATE_WAITING";
}

/** The item before which `number` goes when it is dropped on `target`: "0" is the end. Undefined: it stays. */
export function placeOf(items: readonly QueueItemJson[], number: string, target: string): string | undefined {
  const waiting = items.filter(waits).map((item) => item.number!);
  const from = waiting.indexOf(number),
    to = waiting.indexOf(target);
  if (from < 0 || to < 0 || from === to) return undefined;
  return from > to ? target : (waiting[to + 1] ?? "0");
}

/** The same for one place up or down. */
export function placeBeside(items: readonly QueueItemJson[], number: string, step: -1 | 1): string | undefined {
  const waiting = items.filter(waits).map((item) => item.number!);
  const beside = waiting[waiting.indexOf(number) + step];
  return beside === undefined ? undefined : placeOf(items, number, beside);
}
