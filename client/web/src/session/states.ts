import type { SessionJson } from "../gen/glasswing/v1/session_pb";

export type StateKind = "good" | "caution" | "bad" | "faint" | "busy";

const kKinds: Record<string, StateKind> = {
  SESSION_STATE_CREATED: "busy",
  SESSION_STATE_CAPTURING: "busy",
  SESSION_STATE_SOLVING: "busy",
  SESSION_STATE_PAUSED: "caution",
  SESSION_STATE_CAPTURED: "good",
  SESSION_STATE_DONE: "good",
  SESSION_STATE_FAILED: "bad",
  SESSION_STATE_CANCELLED: "faint",
};

export const kStateNames = Object.keys(kKinds);

export function kindOf({ state }: SessionJson): StateKind {
  return kKinds[state ?? ""] ?? "faint";
}

export function isCapturing({ state }: SessionJson): boolean {
  return state === "SESSION_STATE_CAPTURING" || state === "SESSION_STATE_CREATED";
}

/** What may be asked of a session as it is; the server has the last word. */
export function allowed(session: SessionJson): {
  pause: boolean;
  resume: boolean;
  retry: boolean;
  cancel: boolean;
  solve: boolean;
  remove: boolean;
} {
  const { state, plan, job } = session;
  const moves = state === "SESSION_STATE_CAPTURING" || state === "SESSION_STATE_SOLVING";
  const rests = state === "SESSION_STATE_PAUSED";
  return {
    pause: moves,
    resume: rests,
    retry: state === "SESSION_STATE_FAILED",
    cancel: moves || rests || state === "SESSION_STATE_CREATED",
    solve:
      plan?.calibration === undefined &&
      (state === "SESSION_STATE_CAPTURED" ||
        state === "SESSION_STATE_DONE" ||
        (Number(job ?? 0) > 0 && !moves)),
    remove: !moves && state !== "SESSION_STATE_CREATED",
  };
}

/** How far a session is in what it does now; undefined: nothing is under way. */
export function progressOf(session: SessionJson): { done: number; count: number; what: string } | undefined {
  const { state, provenCount = 0, stepCount = 0, tilesDone = 0, tileCount = 0 } = session;
  if (state === "SESSION_STATE_SOLVING") return { done: tilesDone, count: tileCount, what: "tiles" };
  if (isCapturing(session) || state === "SESSION_STATE_PAUSED" || state === "SESSION_STATE_FAILED")
    return { done: provenCount, count: stepCount, what: "steps" };
  return undefined;
}
