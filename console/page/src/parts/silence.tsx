import { silentSince } from "../api";
import { Failure } from "./failure";

/** Warns that the page is out of date while the server does not answer. */
export function Silence() {
  const since = silentSince.value;
  return (
    <div role="status" class={since ? "silence" : undefined}>
      {since &&
        `The server has not answered since ${since.toLocaleTimeString()}. The page shows the state of then; retrying…`}
    </div>
  );
}

/** The error of a feed that is not live, unless the server does not answer, which <Silence> reports. */
export function FeedFailure({ error }: { error: unknown }) {
  return error === undefined || silentSince.value ? null : <Failure error={error} />;
}
