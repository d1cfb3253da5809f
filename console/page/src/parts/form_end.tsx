import { Failure } from "./failure";

interface FormEndProps {
  /** The submit button's text. */
  action: string;
  busy: boolean;
  /** Of the last attempt. */
  error: unknown;
  close: () => void;
}

/** The end of a dialog's form: what went wrong, and the buttons. */
export function FormEnd({ action, busy, error, close }: FormEndProps) {
  return (
    <>
      {error !== undefined && <Failure error={error} />}
      <div class="row ends">
        <button type="button" onClick={close}>
          Cancel
        </button>
        <button class="primary" disabled={busy}>
          {action}
        </button>
      </div>
    </>
  );
}
