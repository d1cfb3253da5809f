import { useState } from "preact/hooks";
import { mayOperate } from "../api";
import type { ListNodesResponseJson } from "../gen/glasswing/v1/node_service_pb";
import { Dialog } from "../parts/dialog";
import { FormEnd } from "../parts/form_end";
import { hold, holdRig } from "../parts/hold";
import { useAction } from "../parts/use_action";
import { timeText } from "../parts/words";

function HoldDialog({ close }: { close: () => void }) {
  const [reason, setReason] = useState("");
  const { busy, error, act } = useAction();
  const take = async (event: Event): Promise<void> => {
    event.preventDefault();
    if (await act(() => holdRig(reason))) close();
  };
  return (
    <Dialog title="Hold the rig" close={close}>
      <form onSubmit={(event) => void take(event)}>
        <p>
          Only this browser can use the rig until you release it, also between sessions. The hold survives a reload,
          and ends 20 s after the console is closed.
        </p>
        <label>
          Reason
          <input
            type="text"
            required
            maxLength={60}
            placeholder="shown to others"
            value={reason}
            onInput={(event) => setReason(event.currentTarget.value)}
          />
        </label>
        <FormEnd action="Hold" busy={busy} error={error} close={close} />
      </form>
    </Dialog>
  );
}

/** Who uses the rig; operators can reserve it. */
export function Holder({ holder }: { holder: ListNodesResponseJson["holder"] }) {
  const [asked, setAsked] = useState(false);
  return (
    <>
      <span class="note">
        {holder ? (
          <>
            In use
            {holder.client && (
              <>
                {" "}
                by <b>{holder.client}</b>
              </>
            )}{" "}
            since {timeText(holder.since ?? "")}: {holder.what}
          </>
        ) : (
          "The rig is free."
        )}
      </span>
      {mayOperate.value && !hold.value && <button onClick={() => setAsked(true)}>Hold the rig…</button>}
      {asked && <HoldDialog close={() => setAsked(false)} />}
    </>
  );
}
