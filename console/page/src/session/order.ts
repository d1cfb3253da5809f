// The order of the list of sessions, and its filter by time.
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { kStateNames } from "./states";

export const kColumns = ["name", "state", "steps", "method", "begun", "size"] as const;
export type Column = (typeof kColumns)[number];
export interface Order {
  column: Column;
  descending: boolean;
}
export const kNewestFirst: Order = { column: "begun", descending: true };

const kKeys: Record<Column, (session: SessionJson) => string | number> = {
  name: ({ name }) => name ?? "",
  state: ({ state }) => kStateNames.indexOf(state ?? ""),
  steps: ({ stepCount }) => stepCount ?? 0,
  method: ({ method }) => method ?? "",
  begun: ({ created }) => Date.parse(created ?? "") || 0,
  size: ({ archiveBytes }) => Number(archiveBytes ?? 0),
};

function compare(a: string | number, b: string | number): number {
  if (typeof a === "number" && typeof b === "number") return a - b;
  return String(a).localeCompare(String(b), "en", { numeric: true });
}

/** Equal ones stay in the order in which they came. */
export function ordered(sessions: readonly SessionJson[], { column, descending }: Order): SessionJson[] {
  const key = kKeys[column];
  return [...sessions].sort((a, b) => (descending ? -1 : 1) * compare(key(a), key(b)));
}

/** After a click on a column's head: rising, unless it rises already. Of times and sizes, falling first. */
export function clicked(order: Order, column: Column): Order {
  if (order.column === column) return { column, descending: !order.descending };
  return { column, descending: column === "begun" || column === "size" || column === "steps" };
}

/** The start of the day `days` days ago, in local time, as RFC 3339; 0: today's. */
export function startOfDay(days: number, now = new Date()): string {
  return new Date(now.getFullYear(), now.getMonth(), now.getDate() - days).toISOString();
}
