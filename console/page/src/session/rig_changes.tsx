import { call, mayOperate } from "../api";
import type { RigChangeJson, SessionJson } from "../gen/glasswing/v1/session_pb";
import { Failure } from "../parts/failure";
import { Message } from "../parts/message";
import { useAction } from "../parts/use_action";
import { allows } from "./states";

function lostText({ lost = [] }: RigChangeJson): string {
  return lost.map(({ first = 0, last = 0 }) => (first === last ? `${first}` : `${first} to ${last}`)).join(", ");
}

/** What happened to the rig in the middle of the capture, each with a button that captures the lost steps again. */
export function RigChanges({ session }: { session: SessionJson }) {
  const { busy, error, act } = useAction();
  const changes = session.rigChanges ?? [];
  if (changes.length === 0) return null;
  const retakes = mayOperate.value && allows(session, "SESSION_ACTION_RETAKE");
  const retake = (change: RigChangeJson) => () =>
    void act(() => call("SessionService/ResumeSession", { name: session.name ?? "", retake: change.lost ?? [] }));
  return (
    <div class="caution-text" role="alert">
      {changes.map((change) => (
        <p key={change.what}>
          <Message text={`${change.what}; ${change.advice}`} />{" "}
          {retakes && (change.lost?.length ?? 0) > 0 && (
            <button disabled={busy} onClick={retake(change)}>
              Capture steps {lostText(change)} again
            </button>
          )}
        </p>
      ))}
      {error !== undefined && <Failure error={error} />}
    </div>
  );
}
