// The poses of a turntable series (glasswing capture --turn), from its sessions' notes and tags.
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { isCapturing, kindOf } from "./states";

/** What the command wrote in the note: "turn at 10 deg, pose 2 of 36". */
const kNote = /(\S+) at (-?[\d.]+) deg, pose (\d+) of (\d+)/;

export interface Series {
  /** The tag of all its sessions. */
  name: string;
  axis: string;
  /** Of poses, captured or not. */
  count: number;
}

/** The series of a session; undefined: it has none, or its axis does not turn. */
export function seriesOf({ name = "", note = "", tags = [], axes }: SessionJson): Series | undefined {
  const [, axis, , , count] = kNote.exec(note) ?? [];
  const series = tags.find((tag) => name.startsWith(`${tag}-`));
  if (axis === undefined || series === undefined || axes?.[axis] === undefined) return undefined;
  return { name: series, axis, count: Number(count) };
}

export type PoseState = "running" | "captured" | "flagged";

export interface Pose {
  session: string;
  position_deg: number;
  state: PoseState;
}

/** A pose that somebody should look at: it failed, waits, or the rig changed during its capture. */
export function stateOfPose(session: SessionJson): PoseState {
  const kind = kindOf(session);
  if (kind === "bad" || kind === "paused" || kind === "faint" || session.rigChanges?.length) return "flagged";
  return isCapturing(session) ? "running" : "captured";
}

/** In the order of their positions. */
export function posesOf({ axis }: Series, sessions: readonly SessionJson[]): Pose[] {
  const poses = sessions.flatMap((session) => {
    const position = session.axes?.[axis];
    if (position === undefined) return [];
    return [{ session: session.name ?? "", position_deg: Number(position), state: stateOfPose(session) }];
  });
  return poses.sort((a, b) => a.position_deg - b.position_deg);
}

/** Where a position is on a circle of this radius about 0, clockwise from the camera's side, which is below. */
export function placeOf(position_deg: number, radius: number): { x: number; y: number } {
  const angle = (position_deg * Math.PI) / 180;
  return { x: -radius * Math.sin(angle), y: radius * Math.cos(angle) };
}
