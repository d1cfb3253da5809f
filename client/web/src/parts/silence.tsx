import { silentSince } from "../api";

/** Says that what the page shows is no longer so, until the server answers again. */
export function Silence() {
  const since = silentSince.value;
  return (
    <div role="status" class={since ? "silence" : undefined}>
      {since && `The server has not answered since ${since.toLocaleTimeString()}. What stands here is of then; asking again…`}
    </div>
  );
}
