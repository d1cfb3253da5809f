import { useEffect, useState } from "preact/hooks";
import { call } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { ListSessionsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { Failure } from "./failure";

function hasMatte({ matteReady, solvedFrames }: SessionJson): boolean {
  return matteReady === true || (solvedFrames?.length ?? 0) > 0;
}

function hasDraft({ draft }: SessionJson): boolean {
  return draft !== undefined;
}

function describe({ method, objectPixelCount, frameCount, draft }: SessionJson): string {
  if (draft) return `${method ?? ""}, a draft of ${draft.imageCount ?? 0} images`;
  if (frameCount) return `${method ?? ""}, ${frameCount} frames`;
  return `${method ?? ""}, ${Number(objectPixelCount ?? 0).toLocaleString()} pixels of object`;
}

interface SessionChoiceProps {
  page: string;
  title: string;
  /** Whether sessions are listed that have no more than a draft. */
  drafts?: boolean;
}

/** The sessions that have a matte, newest first, as links to `page`. */
export function SessionChoice({ page, title, drafts = false }: SessionChoiceProps) {
  const [sessions, setSessions] = useState<SessionJson[]>();
  const [error, setError] = useState<unknown>();
  useEffect(() => {
    call<ListSessionsResponseJson>("SessionService/ListSessions").then(
      (answer) => setSessions((answer.sessions ?? []).filter((one) => hasMatte(one) || (drafts && hasDraft(one)))),
      setError,
    );
  }, []);
  if (error) return <Failure error={error} />;
  if (!sessions) return null;
  return (
    <section class="card">
      <h1>{title}</h1>
      {sessions.length === 0 && (
        <p>No session has a matte yet. Capture and solve one to see it here.</p>
      )}
      <ul class="choice">
        {sessions.map((session) => (
          <li key={session.name}>
            <a href={`#/${page}/${encodeURIComponent(session.name ?? "")}`}>{session.name}</a>{" "}
            <span class="note">{describe(session)}</span>
          </li>
        ))}
      </ul>
    </section>
  );
}
