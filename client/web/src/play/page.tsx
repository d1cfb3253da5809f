import type { PageProps } from "../pages";
import { Failure } from "../parts/failure";
import { SessionChoice } from "../parts/session_choice";
import { framesOf, useSession } from "../parts/use_session";
import { Player } from "./player";
import "./play.css";

function Session({ name }: { name: string }) {
  const { session, error } = useSession(name);
  if (error) return <Failure error={error} />;
  return session ? <Player key={name} session={name} frames={framesOf(session)} /> : null;
}

export default function Page({ path: [name] }: PageProps) {
  return name === undefined ? (
    <SessionChoice page="play" title="Try a matte in front of backgrounds" />
  ) : (
    <Session name={name} />
  );
}
