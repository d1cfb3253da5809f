import { useEffect, useRef, useState } from "preact/hooks";
import { stream } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { WatchStepsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { follow } from "../parts/feed";
import { isCapturing } from "./states";
import { Timeline } from "./timeline";

/**
 * The session's timeline, followed during the capture, and a version that changes with it, at most once per animation frame.
 */
export function useTimeline(session: SessionJson): { timeline?: Timeline; version: number } {
  const { name = "", stepCount = 0 } = session;
  const timeline = useRef<Timeline | undefined>(undefined);
  const [version, setVersion] = useState(0);
  const phase = isCapturing(session)
    ? "now"
    : `${session.state} ${session.provenCount} ${session.retakenCount}`;
  useEffect(() => {
    if (stepCount === 0) return;
    const cancel = new AbortController();
    let frame = 0;
    const source = async function* (signal: AbortSignal): AsyncGenerator<void> {
      const fresh = new Timeline(stepCount); // a reconnection repeats all events
      for await (const { events = [] } of stream<WatchStepsResponseJson>(
        "SessionService/WatchSteps",
        { name },
        { signal },
      )) {
        fresh.add(events);
        timeline.current = fresh;
        yield;
      }
    };
    const tell = (): void => {
      cancelAnimationFrame(frame);
      frame = requestAnimationFrame(() => setVersion((old) => old + 1));
    };
    void follow(source, tell, cancel.signal);
    return () => (cancel.abort(), cancelAnimationFrame(frame));
  }, [name, stepCount, phase]);
  useEffect(() => () => (timeline.current = undefined), [name]);
  return timeline.current?.stepCount === stepCount ? { timeline: timeline.current, version } : { version };
}
