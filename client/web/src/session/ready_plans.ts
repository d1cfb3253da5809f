// The plans that come with the console, and how each suits the rig.
import { useEffect, useState } from "preact/hooks";
import { ask, call } from "../api";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";
import type { EstimateSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { countText } from "../parts/words";

const kTexts = import.meta.glob<string>("../../../../deploy/plans/*.txtpb", { query: "?raw", import: "default" });

const nameOf = (path: string): string => path.replace(/^.*\/(.*)\.txtpb$/, "$1");
/** The plan to begin with on a rig of which nothing is known yet. */
export const kFirstPlan = "quick";
export const kPlanNames = Object.keys(kTexts)
  .map(nameOf)
  .sort((a, b) => Number(b === kFirstPlan) - Number(a === kFirstPlan) || a.localeCompare(b));

export async function planText(name: string): Promise<string> {
  const path = Object.keys(kTexts).find((each) => nameOf(each) === name);
  return path === undefined ? "" : kTexts[path]!();
}

/** The number of a dry run's warnings that are about this plan; undefined: it cannot run on this rig. */
export type Fit = number | undefined;

/** Of each plan's warnings in a dry run; undefined: it fails. A warning of all plans is about the rig. */
export function fitsOf(warnings: ReadonlyMap<string, readonly string[] | undefined>): Map<string, Fit> {
  const able = [...warnings.values()].filter((each) => each !== undefined);
  const ofPlan = (warning: string): boolean => !able.every((each) => each.includes(warning));
  return new Map([...warnings].map(([name, each]) => [name, each?.filter(ofPlan).length]));
}

/** The plan with the fewest warnings, the first of several; undefined: none can run. */
export function bestPlan(fits: ReadonlyMap<string, Fit>): string | undefined {
  const able = [...fits].filter((each): each is [string, number] => each[1] !== undefined);
  return able.reduce<[string, number] | undefined>((best, each) => (best && best[1] <= each[1] ? best : each), undefined)?.[0];
}

export function fitText(fits: ReadonlyMap<string, Fit>, name: string): string {
  if (!fits.has(name)) return name;
  const warnings = fits.get(name);
  if (warnings === undefined) return `${name}: not for this rig`;
  return warnings === 0 ? `${name}: fits this rig` : `${name}: ${countText(warnings, "warning")}`;
}

async function warningsOf(name: string, signal: AbortSignal): Promise<readonly string[]> {
  const body = await planText(name);
  const plan = (await (await ask("/plans", { method: "POST", body, signal })).json()) as PlanJson;
  const estimate = call<EstimateSessionResponseJson>("SessionService/EstimateSession", { plan }, { signal });
  return (await estimate).warnings ?? [];
}

/** How each plan fits, when all are known; empty until then. */
export function useFits(): ReadonlyMap<string, Fit> {
  const [fits, setFits] = useState<ReadonlyMap<string, Fit>>(new Map());
  useEffect(() => {
    const cancel = new AbortController();
    const look = async (): Promise<void> => {
      const known = new Map<string, readonly string[] | undefined>();
      for (const name of kPlanNames)
        known.set(name, await warningsOf(name, cancel.signal).catch(() => undefined));
      if (!cancel.signal.aborted) setFits(fitsOf(known));
    };
    void look();
    return () => cancel.abort();
  }, []);
  return fits;
}
