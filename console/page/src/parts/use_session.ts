import { useEffect, useState } from "preact/hooks";
import { call } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { GetSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";

export function useSession(name: string): { session?: SessionJson; error?: unknown } {
  const [answer, setAnswer] = useState<{ session?: SessionJson; error?: unknown }>({});
  useEffect(() => {
    const cancel = new AbortController();
    setAnswer({});
    call<GetSessionResponseJson>("SessionService/GetSession", { name }, { signal: cancel.signal }).then(
      ({ session = {} }) => setAnswer({ session }),
      (error: unknown) => cancel.signal.aborted || setAnswer({ error }),
    );
    return () => cancel.abort();
  }, [name]);
  return answer;
}

/** The solved frames of a video; empty: the session has one matte. */
export function framesOf({ frameCount, solvedFrames }: SessionJson): number[] {
  return frameCount ? (solvedFrames ?? []) : [];
}
