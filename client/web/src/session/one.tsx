import { useState } from "preact/hooks";
import type { SessionJson, WatchSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { FeedFailure } from "../parts/silence";
import { useFeed, watched } from "../parts/feed";
import { State } from "../parts/state";
import { plainName, timeText } from "../parts/words";
import { Annotations } from "./annotations";
import { Controls } from "./controls";
import { Progress } from "./progress";
import { stepLimit } from "./rates";
import { Retakes } from "./retakes";
import { Scrubber } from "./scrubber";
import { isCapturing, kindOf } from "./states";
import { TimelineView } from "./timeline_view";
import { useArchive } from "./use_archive";
import { useTimeline } from "./use_timeline";

const kLookAgain_s = 2;

function Head({ session }: { session: SessionJson }) {
  const name = session.name ?? "";
  const looks = session.matteReady || (session.solvedFrames?.length ?? 0) > 0;
  return (
    <div class="row">
      <h1>{name}</h1>
      <State kind={kindOf(session)}>{plainName(session.state, "SESSION_STATE_")}</State>
      <span class="note">
        {session.method}, {timeText(session.created ?? "")}
        {session.startedBy && `, by ${session.startedBy}`}
      </span>
      <span class="spacer" />
      {looks && (
        <>
          <a href={`#/matte/${encodeURIComponent(name)}`}>Its matte</a>
          <a href={`#/play/${encodeURIComponent(name)}`}>Play with it</a>
        </>
      )}
      <a href="#/session">All sessions</a>
    </div>
  );
}

function Session({ session }: { session: SessionJson }) {
  const [selected, select] = useState<number>();
  const archive = useArchive(session);
  const { timeline, version } = useTimeline(session);
  const capturing = isCapturing(session);
  return (
    <>
      <section class="card">
        {session.reason && (
          <p class={kindOf(session) === "bad" ? "failure" : "caution-text"} role="status">
            {session.reason}
          </p>
        )}
        {session.warning && <p class="caution-text">{session.warning}</p>}
        <Progress session={session} timeline={timeline} archive={archive} />
        <Controls session={session} />
      </section>
      {timeline && (
        <section class="card">
          <h2>Steps</h2>
          <TimelineView
            timeline={timeline}
            version={version}
            limit={stepLimit(session.plan, archive.manifest?.monitors ?? [])}
            selected={selected}
            select={select}
          />
        </section>
      )}
      {archive.manifest && (
        <Scrubber
          session={session.name ?? ""}
          manifest={archive.manifest}
          selected={selected}
          select={select}
          capturing={capturing}
        />
      )}
      <Retakes session={session} timeline={timeline} select={select} />
      <Annotations session={session} />
    </>
  );
}

export function One({ name }: { name: string }) {
  const { value, live, error } = useFeed(
    (signal) =>
      watched<WatchSessionResponseJson>("SessionService/WatchSession", { name }, kLookAgain_s, { signal }),
    [name],
  );
  return (
    <div class={live || !value ? "session" : "session stale"}>
      {!live && <FeedFailure error={error} />}
      {value?.session && <Head session={value.session} />}
      {value?.session && <Session key={name} session={value.session} />}
    </div>
  );
}
