import type { MonitorJson } from "../gen/glasswing/v1/archive_pb";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";

const kWindow_s = 5;
const kUsualHold = 2;

/** Steps a second over the capture's last seconds; undefined: too few to say. `times` rise. */
export function recentRate(times: Float64Array, window = kWindow_s): number | undefined {
  const last = times.at(-1);
  if (last === undefined) return undefined;
  let first = times.length - 1;
  while (first > 0 && times[first - 1]! >= last - window) --first;
  const began = times[first]!;
  while (times[first] === began) ++first;  // steps are proven several at once: those of the beginning were made before it
  return last > began ? (times.length - first) / (last - began) : undefined;
}

/** What the plan's slowest monitor allows: each step stands for so many of its refreshes. undefined: no monitor is known. */
export function stepLimit(plan: PlanJson | undefined, monitors: readonly MonitorJson[]): number | undefined {
  const wanted = new Set((plan?.monitors ?? []).map(({ name }) => name));
  const rates = monitors.filter(({ name }) => wanted.size === 0 || wanted.has(name)).map(({ refreshHz }) => Number(refreshHz ?? 0));
  const slowest = Math.min(...rates.filter((rate) => rate > 0));
  return Number.isFinite(slowest) ? slowest / (plan?.holdRefreshes ?? kUsualHold) : undefined;
}

/** undefined: nothing moves. */
export function secondsLeft(remaining: number, perSecond: number | undefined): number | undefined {
  return perSecond !== undefined && perSecond > 0 ? remaining / perSecond : undefined;
}
