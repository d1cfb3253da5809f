import { mayOperate } from "../api";
import { hold, holdLost, releaseRig } from "./hold";
import { useAction } from "./use_action";
import { errorText } from "./words";

/** Says that this browser holds the rig, or why it no longer does. */
export function Held() {
  const { busy, error, act } = useAction();
  if (!mayOperate.value || (!hold.value && holdLost.value === null)) return null;
  return (
    <div class="held row" role="status">
      {hold.value ? (
        <>
          <span>
            You hold the rig: <b>{hold.value.reason}</b>
          </span>
          <button class="inline" disabled={busy} onClick={() => void act(releaseRig)}>
            Release
          </button>
        </>
      ) : (
        <>
          <span>You no longer hold the rig: {holdLost.value}</span>
          <button class="inline" onClick={() => (holdLost.value = null)}>
            Dismiss
          </button>
        </>
      )}
      {error !== undefined && <span class="failure">{errorText(error)}</span>}
    </div>
  );
}
