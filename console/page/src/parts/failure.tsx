import { Message } from "./message";
import { errorText } from "./words";

/** An error's message. */
export function Failure({ error }: { error: unknown }) {
  return (
    <p class="failure" role="alert">
      <Message text={errorText(error)} />
    </p>
  );
}
