import type { ClockOffsetJson } from "../gen/glasswing/v1/node_service_pb";
import { nanosecondsText } from "../parts/words";

const kMax = 900; // samples kept: the server's, one every ten seconds, and then one per second

export interface History {
  first_ns: number; // reference of the other offsets: clocks count from the start of their machines
  time: number[];
  offset: number[];
  above: number[];
  below: number[];
}

/** Of a node's clock from the server's, with its bound. */
export function offsetText({ offsetNs, boundNs }: ClockOffsetJson): string {
  return `${nanosecondsText(Number(offsetNs ?? 0))} ± ${nanosecondsText(Number(boundNs ?? 0))}`;
}

/** Adds a measurement unless it is known. Undefined: nothing is known yet. */
export function withOffset(known: History | undefined, clock: ClockOffsetJson, now: number): History {
  const offset = Number(clock.offsetNs ?? 0),
    bound = Number(clock.boundNs ?? 0);
  const history = known ?? { first_ns: offset, time: [], offset: [], above: [], below: [] };
  const { first_ns } = history;
  const columns: [number[], number][] = [
    [history.time, now - Number(clock.ageS ?? 0)],
    [history.offset, offset - first_ns],
    [history.above, offset - first_ns + bound],
    [history.below, offset - first_ns - bound],
  ];
  if ((history.time.at(-1) ?? 0) >= columns[0]![1]) return history; // not measured since
  for (const [column, value] of columns) {
    column.push(value);
    if (column.length > kMax) column.shift();
  }
  return history;
}
