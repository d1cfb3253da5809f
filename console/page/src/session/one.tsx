import { useMemo, useState } from "preact/hooks";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { WatchSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { isCaptured } from "../parts/archive";
import { Downloads } from "../parts/downloads";
import { FeedFailure } from "../parts/silence";
import { useFeed, watched } from "../parts/feed";
import { Message } from "../parts/message";
import { State } from "../parts/state";
import { plainName, timeText } from "../parts/words";
import { Annotations } from "./annotations";
import { Controls } from "./controls";
import { framesBySteps, newestOf, placeOfStep, showpieceOf } from "./frames";
import { type Order, ordered } from "./order";
import { PictureDue } from "./picture_due";
import { PoseRing } from "./pose_ring";
import { Progress } from "./progress";
import { stepLimit } from "./rates";
import { Retakes } from "./retakes";
import { RigChanges } from "./rig_changes";
import { Scrubber } from "./scrubber";
import { SessionTable } from "./session_table";
import { isCalibration, isCapturing, isUnderWay, kindOf, waitingText } from "./states";
import { TimelineView } from "./timeline_view";
import { useArchive } from "./use_archive";
import { useTimeline } from "./use_timeline";

const kLookAgain_s = 2;

function matteOf(session: SessionJson): "done" | "draft" | "partial" | undefined {
  if (session.views) return undefined; // one for each camera
  if (session.frameCount) return undefined; // a video has one for each frame, on the matte's page
  if (session.draft) return "draft";
  if (session.state === "SESSION_STATE_SOLVING" && (session.tilesDone ?? 0) > 0) return "partial";
  return session.matteReady ? "done" : undefined;
}

function Head({ session }: { session: SessionJson }) {
  const name = session.name ?? "";
  const looks = !session.views && (session.matteReady || (session.solvedFrames?.length ?? 0) > 0);
  return (
    <div class="row">
      <h1>{name}</h1>
      <State kind={kindOf(session)}>{plainName(session.state, "SESSION_STATE_")}</State>
      <span class="note">
        {session.method}, {timeText(session.created ?? "")}
        {session.startedBy && `, by ${session.startedBy}`}
      </span>
      {session.viewOf && (
        <span>
          camera {session.viewCamera} of{" "}
          <a href={`#/session/${encodeURIComponent(session.viewOf)}`}>{session.viewOf}</a>
        </span>
      )}
      <span class="spacer" />
      <Downloads session={name} captured={isCaptured(session)} matte={matteOf(session)} />
      {looks && <a href={`#/matte/${encodeURIComponent(name)}`}>View the matte</a>}
      {(looks || session.draft) && (
        <a href={`#/play/${encodeURIComponent(name)}`}>
          {looks ? "Try backgrounds" : "Try backgrounds with the draft"}
        </a>
      )}
      {isCalibration(session) ? <a href="#/calibrations">All calibrations</a> : <a href="#/session">All sessions</a>}
    </div>
  );
}

/** What it waits for, why it rests, and what is uncertain. */
function Says({ session }: { session: SessionJson }) {
  return (
    <>
      {session.waiting && (
        <p class="caution-text" role="status">
          <Message text={waitingText(session.waiting)} />
        </p>
      )}
      {session.reason && !(session.waiting && isUnderWay(session)) && (
        <p class={kindOf(session) === "bad" ? "failure" : "caution-text"} role="status">
          <Message text={session.reason} />
        </p>
      )}
      {session.warning && (
        <p class="caution-text">
          <Message text={session.warning} />
        </p>
      )}
    </>
  );
}

/** A session with several cameras: the views that it sums up. */
function Views({ session, views }: { session: SessionJson; views: readonly SessionJson[] }) {
  const [order, setOrder] = useState<Order>({ column: "name", descending: false });
  return (
    <>
      <section class="card">
        <Says session={session} />
        <RigChanges session={session} />
        <Controls session={session} />
      </section>
      <section class="card">
        <h2>Cameras</h2>
        <SessionTable sessions={ordered(views, order)} order={order} setOrder={setOrder} />
      </section>
      <Annotations session={session} />
    </>
  );
}

function Session({ session }: { session: SessionJson }) {
  const archive = useArchive(session);
  const frames = useMemo(() => framesBySteps(archive.manifest ?? {}), [archive.manifest]);
  const [file, setFile] = useState<string>(); // the chosen frame's; undefined: none
  const { timeline, version } = useTimeline(session);
  const capturing = isCapturing(session);
  const chosen = file === undefined ? -1 : frames.findIndex((frame) => frame.file === file);
  const at = chosen >= 0 ? chosen : capturing ? newestOf(frames) : showpieceOf(frames);
  const choose = (place: number): void => setFile(frames[place]?.file);
  const chooseStep = (step: number): void => choose(placeOfStep(frames, step));
  return (
    <>
      <section class="card">
        <Says session={session} />
        <RigChanges session={session} />
        <Progress session={session} timeline={timeline} archive={archive} />
        <Controls session={session} />
      </section>
      <PictureDue session={session} />
      <PoseRing session={session} />
      {timeline && (
        <section class="card">
          <h2>Steps</h2>
          <TimelineView
            timeline={timeline}
            version={version}
            limit={stepLimit(session.plan, archive.manifest?.monitors ?? [])}
            selected={chosen >= 0 ? frames[chosen]?.step : undefined}
            select={chooseStep}
          />
        </section>
      )}
      <Scrubber
        session={session.name ?? ""}
        frames={frames}
        at={at}
        choose={choose}
        following={capturing ? chosen < 0 : undefined}
        follow={(on) => setFile(on ? undefined : frames[at]?.file)}
      />
      <Retakes session={session} timeline={timeline} select={chooseStep} />
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
      {value?.session &&
        (value.session.views ? (
          <Views session={value.session} views={value.session.views} />
        ) : (
          <Session key={name} session={value.session} />
        ))}
    </div>
  );
}
