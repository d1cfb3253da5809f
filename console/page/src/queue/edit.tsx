import { useState } from "preact/hooks";
import { call } from "../api";
import type { QueueItemJson } from "../gen/glasswing/v1/queue_service_pb";
import { Dialog } from "../parts/dialog";
import { FormEnd } from "../parts/form_end";
import { useAction } from "../parts/use_action";

const kConditions = {
  solve: "Solve it as soon as it is captured",
  approval: "Wait for an approval",
  steady: "Wait for one if the rig changed in the capture before",
  doctor: "Test the rig before",
  noWarnings: "Wait until a dry run warns of nothing",
  retakeUnusual: "Capture it again at the end if it is unusual",
  pauseAfter: "Pause the queue after it",
} as const;

/** Changes an item that waits; its plan stays. */
export function EditDialog({ item, close }: { item: QueueItemJson; close: () => void }) {
  const [wish, setWish] = useState(item.wish ?? {});
  const { busy, error, act } = useAction();
  const save = async (event: Event): Promise<void> => {
    event.preventDefault();
    await act(async () => {
      await call("QueueService/EditQueueItem", { number: item.number, wish });
      close();
    });
  };
  return (
    <Dialog title={`Edit item ${item.number}`} close={close}>
      <form class="fields" onSubmit={(event) => void save(event)}>
        <label>
          Session
          <input value={wish.session ?? ""} onInput={(event) => setWish({ ...wish, session: event.currentTarget.value })} />
        </label>
        <label>
          Note
          <input value={wish.note ?? ""} onInput={(event) => setWish({ ...wish, note: event.currentTarget.value })} />
        </label>
        {(Object.keys(kConditions) as (keyof typeof kConditions)[]).map((name) => (
          <label key={name}>
            <input
              type="checkbox"
              checked={wish[name] ?? false}
              onChange={(event) => setWish({ ...wish, [name]: event.currentTarget.checked })}
            />
            {kConditions[name]}
          </label>
        ))}
        <FormEnd action="Save" busy={busy} error={error} close={close} />
      </form>
    </Dialog>
  );
}
