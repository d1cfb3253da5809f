import type { ListWarningsResponseJson } from "../gen/glasswing/v1/log_service_pb";
import { Dialog } from "../parts/dialog";
import { FeedFailure } from "../parts/silence";
import { polled, useFeed } from "../parts/feed";
import { State } from "../parts/state";
import { timeText } from "../parts/words";

/** What a daemon logged of warnings and errors, the newest first. `node` undefined: the server. */
export function LogDialog({ node, close }: { node?: string; close: () => void }) {
  const { value, live, error } = useFeed(
    (signal) =>
      polled<ListWarningsResponseJson>("LogService/ListWarnings", {}, 2, node === undefined ? { signal } : { node, signal }),
    [node],
  );
  const lines = [...(value?.lines ?? [])].reverse();
  return (
    <Dialog title={`Log of ${node ?? "the server"}`} close={close}>
      {!live && <FeedFailure error={error} />}
      {value && lines.length === 0 && <p>It has logged no warning and no error since it was started.</p>}
      {lines.length > 0 && (
        <>
          <p class="note">The newest warnings and errors since it was started, at most 200.</p>
          <ol class="log" tabIndex={0} aria-label="Warnings and errors, the newest first">
            {lines.map(({ time = "", level = "", text = "" }, i) => (
              <li key={`${time} ${i}`}>
                <time dateTime={time} title={time}>
                  {timeText(time)}
                </time>{" "}
                <State kind={level === "warning" ? "caution" : "bad"}>{level}</State> <span>{text}</span>
              </li>
            ))}
          </ol>
        </>
      )}
      <div class="row ends">
        <button onClick={close}>Close</button>
      </div>
    </Dialog>
  );
}
