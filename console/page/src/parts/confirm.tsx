import type { ComponentChildren } from "preact";
import { Dialog } from "./dialog";
import { useAction } from "./use_action";
import { errorText } from "./words";

interface ConfirmProps {
  title: string;
  /** The button's text. */
  action: string;
  /** The other button's text; default: "Keep". Then nothing is lost by the action. */
  refusal?: string;
  /** Something is lost although `refusal` is named. */
  danger?: boolean;
  run: () => Promise<unknown>;
  /** Called after `run` succeeded and the dialog was closed. */
  done: () => void;
  close: () => void;
  children: ComponentChildren;
}

/** Asks before something is lost, or before the rig is used. */
export function Confirm({ title, action, refusal, danger = !refusal, run, done, close, children }: ConfirmProps) {
  const { busy, error, act } = useAction();
  const confirm = async (): Promise<void> => {
    if (!(await act(run))) return;
    close();
    done();
  };
  return (
    <Dialog title={title} close={close}>
      {children}
      {error !== undefined && (
        <p class="failure" role="alert">
          {errorText(error)}
        </p>
      )}
      <div class="row ends">
        <button type="button" onClick={close}>
          {refusal ?? "Keep"}
        </button>
        <button type="button" class={danger ? "danger" : "primary"} disabled={busy} onClick={() => void confirm()}>
          {action}
        </button>
      </div>
    </Dialog>
  );
}
