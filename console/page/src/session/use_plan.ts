import { useEffect, useState } from "preact/hooks";
import { ask, call } from "../api";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";
import type { EstimateSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { waited } from "../parts/feed";
import { withCameras } from "./cameras";

export interface PlanView {
  plan?: PlanJson;
  estimate?: EstimateSessionResponseJson;
  error?: unknown;
}

export const kPause_s = 0.4; // debounces typing

/**
 * The server's parse and estimate of a plan's text and the name, shortly after they changed; with the chosen ones of
 * the cameras that are `up`.
 */
export function usePlan(
  text: string,
  name: string,
  up: readonly string[] | undefined,
  chosen: ReadonlySet<string> | undefined,
): PlanView {
  const [view, setView] = useState<PlanView>({});
  useEffect(() => {
    const cancel = new AbortController();
    const { signal } = cancel;
    const look = async (): Promise<void> => {
      setView({});
      await waited(kPause_s, signal);
      if (signal.aborted || text.trim() === "" || !up) return;
      const parsed = (await (await ask("/plans", { method: "POST", body: text, signal })).json()) as PlanJson;
      const plan = withCameras(parsed, up, chosen);
      setView({ plan });
      setView({
        plan,
        estimate: await call<EstimateSessionResponseJson>(
          "SessionService/EstimateSession",
          { name, plan },
          { signal },
        ),
      });
    };
    look().catch((error: unknown) => signal.aborted || setView((old) => ({ ...old, error })));
    return () => cancel.abort();
  }, [text, name, up, chosen]);
  return view;
}
