import type { MonitorJson } from "../gen/glasswing/v1/archive_pb";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";

const kWindow_s = 5;
const kUsualHold = 2;

/** Steps a second over the capture's last seconds, from when each was proven; undefined: none was. `times` rise from 0. */
export function recentRate(times: Float64Array, window = kWindow_s): number | undefined {
  const last = times.at(-1);
  if (!last) return undefined;
  let first = times.length;
  while (first > 0 && times[first - 1]! > last - window) --first;
  return (times.length - first) / Math.min(window, last);
}

/** What the plan's slowest monitor allows: each step stands for so many of its refreshes. undefined: no monitor is known. */
export function stepLimit(plan: PlanJson | undefined, monitors: readonly MonitorJson[]): number | undefined {
  const wanted = new Set((plan?.monitors ?? []).map(({ name }) => name));
  const rates = monitors
    .filter(({ name }) => wanted.size === 0 || wanted.has(name))
    .map(({ refreshHz }) => Number(refreshHz ?? 0));
  const slowest = Math.min(...rates.filter((rate) => rate > 0));
  return Number.isFinite(slowest) ? slowest / (plan?.holdRefreshes ?? kUsualHold) : undefined;
}

/** undefined: nothing moves. */
export function secondsLeft(remaining: number, perSecond: number | undefined): number | undefined {
  return perSecond !== undefined && perSecond > 0 ? remaining / perSecond : undefined;
}
