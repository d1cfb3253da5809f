// The plans that come with the console, and how each suits the rig.
import { useEffect, useState } from "preact/hooks";
import { ask, call } from "../api";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";
import type { EstimateSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { countText } from "../parts/words";
import { withCameras } from "./cameras";

const kTexts = import.meta.glob<string>("../../../../deploy/plans/*.txtpb", { query: "?raw", import: "default" });

const nameOf = (path: string): string => path.replace(/^.*\/(.*)\.txtpb$/, "$1");
export const kPlanNames = Object.keys(kTexts)
  .map(nameOf)
  .sort((a, b) => a.localeCompare(b, "en", { numeric: true }));

/** What each is for. */
export const kPurposes: Readonly<Record<string, string>> = {
  alpha: "solid or thin things that bend no light, four images",
  blur: "how far camera and monitor blur, with an empty stage",
  crystal: "everything that a clear object shows, one small monitor",
  "design-30": "waves, 30 images: a first look",
  "design-50": "waves, 50 images",
  "design-75": "waves, 75 images",
  "design-100": "waves, 100 images: close to the best from a sixth of its images",
  "design-200": "waves, 200 images",
  desk: "a clear object in front of a monitor of 1920×1080",
  fringe: "clear objects with one path of light a pixel, 76 images",
  hierarchical: "few images, a coarser matte",
  hundred: "stripes, a hundred images",
  quick: "to try a rig: wide stripes, seconds",
  "slow-camera": "a camera of one frame a second, 46 images",
  "two-monitors": "a monitor behind and one to the left",
  video: "something that moves, such as liquid being poured",
};

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

export function fitText(fits: ReadonlyMap<string, Fit>, name: string): string {
  const text = kPurposes[name] ? `${name}: ${kPurposes[name]}` : name;
  if (!fits.has(name)) return text;
  const warnings = fits.get(name);
  if (warnings === undefined) return `${text} (not for this rig)`;
  return warnings === 0 ? text : `${text} (${countText(warnings, "warning")})`;
}

async function warningsOf(name: string, up: readonly string[], signal: AbortSignal): Promise<readonly string[]> {
  const body = await planText(name);
  const parsed = (await (await ask("/plans", { method: "POST", body, signal })).json()) as PlanJson;
  const plan = withCameras(parsed, up);
  const estimate = call<EstimateSessionResponseJson>("SessionService/EstimateSession", { plan }, { signal });
  return (await estimate).warnings ?? [];
}

/** How each plan fits with all cameras that are `up`, when all are known; empty until then. */
export function useFits(up: readonly string[] | undefined): ReadonlyMap<string, Fit> {
  const [fits, setFits] = useState<ReadonlyMap<string, Fit>>(new Map());
  useEffect(() => {
    const cancel = new AbortController();
    const look = async (): Promise<void> => {
      if (!up) return;
      const known = new Map<string, readonly string[] | undefined>();
      for (const name of kPlanNames)
        known.set(name, await warningsOf(name, up, cancel.signal).catch(() => undefined));
      if (!cancel.signal.aborted) setFits(fitsOf(known));
    };
    void look();
    return () => cancel.abort();
  }, [up]);
  return fits;
}
