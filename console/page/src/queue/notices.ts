// What people want to be told of while they look elsewhere.
import type { QueueItemJson } from "../gen/glasswing/v1/queue_service_pb";

function title({ session, wish, number }: QueueItemJson): string {
  return session || wish?.session || `item ${number}`;
}

/** What happened between two looks at the queue: a person is needed, an item failed or is unusual, all is done. */
export function notices(before: readonly QueueItemJson[], now: readonly QueueItemJson[]): string[] {
  const known = new Map(before.map((item) => [item.number, item]));
  const told: string[] = [];
  for (const item of now) {
    const old = known.get(item.number);
    if (old === undefined) continue;
    const needed = item.waitsSince && !old.waitsSince;
    const ended = item.ended && !old.ended && item.reason;
    if (needed || ended) told.push(`${title(item)}: ${item.reason ?? "waits for a person"}`);
  }
  const open = (items: readonly QueueItemJson[]): boolean => items.some((item) => !item.ended);
  // Items that have ended may not be listed.
  if (open(before) && !open(now)) told.push("The queue is done.");
  return told;
}
