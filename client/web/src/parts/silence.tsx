import { silentSince } from "../api";
import { Failure } from "./failure";

/** Says that what the page shows is no longer so, until the server answers again. */
export function Silence() {
  const since = silentSince.value;
  return (
    <div role="status" class={since ? "silence" : undefined}>
      {since &&
        `The server has not answered since ${since.toLocaleTimeString()}. What stands here is of then; asking again…`}
    </div>
  );
}

/** Why something is not shown as it is now, unless it is the silence of the server, which stands above. */
export function FeedFailure({ error }: { error: unknown }) {
  return error === undefined || silentSince.value ? null : <Failure error={error} />;
}
