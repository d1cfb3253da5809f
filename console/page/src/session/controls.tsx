import { useState } from "preact/hooks";
import { call, mayOperate } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { DeleteSessionResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { Confirm } from "../parts/confirm";
import { Dialog } from "../parts/dialog";
import { Failure } from "../parts/failure";
import { FormEnd } from "../parts/form_end";
import { useAction } from "../parts/use_action";
import { bytesText, timeText } from "../parts/words";
import { fitCalibration } from "../rig/calibrate";
import { useRunningFit } from "../rig/running_fit";
import { SolveDialog } from "./solve";
import { allows, isCalibration } from "./states";

function RetryDialog({ name, close }: { name: string; close: () => void }) {
  const [retries, setRetries] = useState("");
  const { busy, error, act } = useAction();
  const retry = async (event: Event): Promise<void> => {
    event.preventDefault();
    const request = retries === "" ? { name } : { name, retries: Number(retries) };
    if (await act(() => call("SessionService/ResumeSession", request))) close();
  };
  return (
    <Dialog title={`Try ${name} again`} close={close}>
      <form onSubmit={(event) => void retry(event)}>
        <p>Proven steps and solved tiles are kept; the rest is repeated.</p>
        <label>
          Repeat a step up to
          <input
            class="short"
            type="number"
            min={0}
            max={100}
            placeholder="plan's"
            value={retries}
            onInput={(event) => setRetries(event.currentTarget.value)}
          />{" "}
          times
        </label>
        <FormEnd action="Try again" busy={busy} error={error} close={close} />
      </form>
    </Dialog>
  );
}

function afterCancel(session: SessionJson): string {
  if (session.state === "SESSION_STATE_SOLVING" || session.tileCount)
    return "The solve ends. The frames stay, and a matte of before.";
  return "A cancelled capture cannot be resumed or solved; to continue it later, pause it instead.";
}

/** A button for each action that the server allows now; viewers get none. */
export function Controls({ session }: { session: SessionJson }) {
  const [asked, setAsked] = useState<"solve" | "retry" | "cancel" | "remove">();
  const [fitted, setFitted] = useState(false);
  const { busy, error, act } = useAction();
  const canBeFitted = isCalibration(session) && session.state === "SESSION_STATE_CAPTURED";
  const fitting = useRunningFit(session.name ?? "", canBeFitted && mayOperate.value);
  if (!mayOperate.value)
    return <p class="note">You are logged in as a viewer and cannot change anything.</p>;
  const name = session.name ?? "";
  const change = (method: string) => () => void act(() => call(`SessionService/${method}`, { name }));
  return (
    <div class="row controls">
      {allows(session, "SESSION_ACTION_PAUSE") && (
        <button disabled={busy} onClick={change("PauseSession")}>
          Pause
        </button>
      )}
      {allows(session, "SESSION_ACTION_RESUME") && (
        <button class="primary" disabled={busy} onClick={change("ResumeSession")}>
          Resume
        </button>
      )}
      {allows(session, "SESSION_ACTION_RETRY") && (
        <button class="primary" onClick={() => setAsked("retry")}>
          Retry…
        </button>
      )}
      {allows(session, "SESSION_ACTION_SOLVE") && (
        <button class={session.matteReady ? "" : "primary"} onClick={() => setAsked("solve")}>
          {session.matteReady ? "Solve again…" : "Solve…"}
        </button>
      )}
      {canBeFitted && (
        <button class="primary" disabled={busy || fitting !== undefined} onClick={() => void act(() => fitCalibration(name)).then(setFitted)}>
          Fit the calibration
        </button>
      )}
      {fitting !== undefined && (
        <span class="note" role="status">
          Being fitted since {timeText(fitting)}; it may take some minutes, also without this page.
        </span>
      )}
      {fitted && (
        <b role="status">
          Fitted: <a href="#/calibrations">Calibrations</a>
        </b>
      )}
      {allows(session, "SESSION_ACTION_CANCEL") && (
        <button disabled={busy} onClick={() => setAsked("cancel")}>
          Cancel…
        </button>
      )}
      {allows(session, "SESSION_ACTION_DELETE") && (
        <button class="danger" onClick={() => setAsked("remove")}>
          Delete…
        </button>
      )}
      {error !== undefined && <Failure error={error} />}
      {asked === "solve" && <SolveDialog session={session} close={() => setAsked(undefined)} />}
      {asked === "retry" && <RetryDialog name={name} close={() => setAsked(undefined)} />}
      {asked === "cancel" && (
        <Confirm
          title={`Cancel ${name}?`}
          action="Cancel it"
          refusal="Go on"
          danger
          run={async () => change("CancelSession")()}
          done={() => undefined}
          close={() => setAsked(undefined)}
        >
          <p>{afterCancel(session)}</p>
        </Confirm>
      )}
      {asked === "remove" && (
        <Confirm
          title={`Delete ${name}?`}
          action="Delete"
          run={() => call<DeleteSessionResponseJson>("SessionService/DeleteSession", { name, trash: true })}
          done={() => (location.hash = isCalibration(session) ? "#/calibrations" : "#/session")}
          close={() => setAsked(undefined)}
        >
          <p>It stays in the trash for a day; glasswing undelete takes it back.</p>
        </Confirm>
      )}
    </div>
  );
}

export function sizeText({ archiveBytes }: SessionJson): string {
  return Number(archiveBytes ?? 0) > 0 ? bytesText(Number(archiveBytes)) : "–";
}
