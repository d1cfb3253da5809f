// Places of ticks on axes.
import { secondsText } from "./words";

const kWhole = [1, 2, 5];
const kTimes_s = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600];

/** The smallest of 1, 2, 5, 10, 20, ... that has at most `max` steps in `span`. */
export function stepOf(span: number, max: number): number {
  for (let ten = 1; ; ten *= 10)
    for (const digit of kWhole) if (span / (digit * ten) <= max) return digit * ten;
}

/** The same of seconds, with steps of minutes and hours. */
export function timeStepOf(span_s: number, max: number): number {
  return kTimes_s.find((step) => span_s / step <= max) ?? 3600 * stepOf(span_s / 3600, max);
}

/** The range of an axis for values from `low` to `high`, null without any; what is never negative gets no negative end. */
export function rangeOf(low: number | null, high: number | null): [number, number] {
  if (low === null || high === null) return [0, 1];
  const room = low === high ? Math.abs(low) || 1 : 0.1 * (high - low);
  return [low < 0 ? low - room : Math.max(0, low - room), high + room];
}

/** Multiples of `step` from 0 to `last`. */
export function ticksTo(last: number, step: number): number[] {
  return Array.from({ length: Math.floor(last / step) + 1 }, (_, i) => i * step);
}

/** A whole number of seconds, as a tick's label. */
export function timeTickText(seconds: number): string {
  if (seconds < 60) return `${seconds} s`;
  return seconds < 3600 && seconds % 60 === 0 ? `${seconds / 60} min` : secondsText(seconds);
}
