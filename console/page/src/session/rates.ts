import type { MonitorJson } from "../gen/glasswing/v1/archive_pb";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";

const kWindow_s = 5;
const kUsualHold = 2;

/**
 * Steps per second over the last `window` seconds before `now`. `times`: when each step was proven, ascending from 0; undefined:
 * none was.
 */
export function recentRate(times: Float64Array, now: number, window = kWindow_s): number | undefined {
  const last = times.at(-1);
  if (!last) return undefined;
  const end = Math.max(now, last);
  let first = times.length;
  while (first > 0 && times[first - 1]! > end - window) --first;
  return (times.length - first) / Math.min(window, end);
}

/** Steps per second that the plan's slowest monitor allows, at holdRefreshes per step; undefined: no monitor is known. */
export function stepLimit(plan: PlanJson | undefined, monitors: readonly MonitorJson[]): number | undefined {
  const wanted = new Set((plan?.monitors ?? []).map(({ name }) => name));
  const rates = monitors
    .filter(({ name }) => wanted.size === 0 || wanted.has(name))
    .map(({ refreshHz }) => Number(refreshHz ?? 0));
  const slowest = Math.min(...rates.filter((rate) => rate > 0));
  return Number.isFinite(slowest) ? slowest / (plan?.holdRefreshes ?? kUsualHold) : undefined;
}

/** undefined: no progress. */
export function secondsLeft(remaining: number, perSecond: number | undefined): number | undefined {
  return perSecond !== undefined && perSecond > 0 ? remaining / perSecond : undefined;
}
