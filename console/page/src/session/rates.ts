import type { MonitorJson } from "../gen/glasswing/v1/archive_pb";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";

const kWindow_s = 5;
const kMin_s = 1;
const kUsualHold = 2;

/**
 * Steps per second over the last `window` seconds before `now`, at most since the first proof: the time before it, in which the
 * rig starts, is no part of the rate. `times`: when each step was proven, ascending; undefined: less than a second has passed
 * since the first.
 */
export function recentRate(times: Float64Array, now: number, window = kWindow_s): number | undefined {
  const last = times.at(-1);
  if (last === undefined) return undefined;
  const end = Math.max(now, last);
  const begin = Math.max(end - window, times[0]!);
  if (end - begin < kMin_s) return undefined;
  let first = times.length;
  while (first > 0 && times[first - 1]! > begin) --first;
  return (times.length - first) / (end - begin);
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
