import type { SessionActionJson, SessionJson, WaitingJson } from "../gen/glasswing/v1/session_pb";
import type { StateKind } from "../parts/state";
import { timeText } from "../parts/words";

const kKinds: Record<string, StateKind> = {
  SESSION_STATE_CREATED: "busy",
  SESSION_STATE_CAPTURING: "busy",
  SESSION_STATE_SOLVING: "busy",
  SESSION_STATE_PAUSED: "paused",
  SESSION_STATE_CAPTURED: "kept",
  SESSION_STATE_DONE: "good",
  SESSION_STATE_FAILED: "bad",
  SESSION_STATE_CANCELLED: "faint",
  SESSION_STATE_DAMAGED: "bad",
};

export const kStateNames = Object.keys(kKinds);

export function kindOf({ state }: SessionJson): StateKind {
  return kKinds[state ?? ""] ?? "faint";
}

/** It measures the rig's devices; other sessions hold an object. */
export function isCalibration({ plan }: SessionJson): boolean {
  return plan?.calibration !== undefined;
}

export function isCapturing({ state }: SessionJson): boolean {
  return state === "SESSION_STATE_CAPTURING" || state === "SESSION_STATE_CREATED";
}

export function isUnderWay(session: SessionJson): boolean {
  return isCapturing(session) || session.state === "SESSION_STATE_SOLVING";
}

/** The server's words for what a session waits for. */
export function waitingText({ what = "", since, advice }: WaitingJson): string {
  return `Waiting: ${what}${since ? `, since ${timeText(since)}` : ""}; ${advice}`;
}

/** True if the server would accept this call for the session as it is now. */
export function allows({ allowedActions = [] }: SessionJson, action: SessionActionJson): boolean {
  return allowedActions.includes(action);
}

/** The progress of the work under way; undefined if there is none. */
export function progressOf(session: SessionJson): { done: number; count: number; what: string } | undefined {
  const { state, provenCount = 0, stepCount = 0, tilesDone = 0, tileCount = 0 } = session;
  if (state === "SESSION_STATE_SOLVING") return { done: tilesDone, count: tileCount, what: "tiles" };
  if (isCapturing(session) || state === "SESSION_STATE_PAUSED" || state === "SESSION_STATE_FAILED")
    return { done: provenCount, count: stepCount, what: "steps" };
  return undefined;
}
