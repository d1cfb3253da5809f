import type { WatchSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";
import type { PageProps } from "../pages";
import { Failure } from "../parts/failure";
import { useFeed, watched } from "../parts/feed";
import { SessionChoice } from "../parts/session_choice";
import { framesOf } from "../parts/use_session";
import { Player } from "./player";
import "./play.css";

const kLookAgain_s = 2;

function Session({ name }: { name: string }) {
  const { value, live, error } = useFeed(
    (signal) =>
      watched<WatchSessionResponseJson>("SessionService/WatchSession", { name }, kLookAgain_s, { signal }),
    [name],
  );
  const session = value?.session;
  if (!session) return error !== undefined && !live ? <Failure error={error} /> : null;
  const frames = framesOf(session);
  if (session.state === "SESSION_STATE_CAPTURING" && !session.matteReady && !session.draft)
    return <p class="note">The first draft of {name} comes while it is captured.</p>;
  return <Player key={name} session={name} frames={frames} draft={session.draft} />;
}

export default function Page({ path: [name] }: PageProps) {
  return name === undefined ? (
    <SessionChoice page="play" title="Try a matte in front of backgrounds" drafts />
  ) : (
    <Session name={name} />
  );
}
