import { useEffect, useRef, useState } from "preact/hooks";
import { call, mayOperate } from "../api";
import type { GetQueueResponseJson, QueueItemJson, QueueItemStateJson } from "../gen/glasswing/v1/queue_service_pb";
import { polled, useFeed } from "../parts/feed";
import { Message } from "../parts/message";
import { FeedFailure } from "../parts/silence";
import { State, type StateKind } from "../parts/state";
import { useAction } from "../parts/use_action";
import { errorText, timeText } from "../parts/words";
import { EditDialog } from "./edit";
import { notices } from "./notices";
import { placeBeside, placeOf, waits } from "./order";
import "./queue.css";

const kStates: Partial<Record<QueueItemStateJson, [StateKind, string]>> = {
  QUEUE_ITEM_STATE_WAITING: ["faint", "waiting"],
  QUEUE_ITEM_STATE_RUNNING: ["busy", "running"],
  QUEUE_ITEM_STATE_PAUSED: ["paused", "needs a person"],
  QUEUE_ITEM_STATE_SOLVING: ["kept", "solving"],
  QUEUE_ITEM_STATE_DONE: ["good", "done"],
  QUEUE_ITEM_STATE_FAILED: ["bad", "failed"],
};

/** Captured, and an outlier of its series. */
function isUnusual({ state, reason }: QueueItemJson): boolean {
  return state === "QUEUE_ITEM_STATE_DONE" && !!reason;
}

type Act = (method: string, request: object) => void;

function Name({ item: { session, wish, number } }: { item: QueueItemJson }) {
  if (!session) return <b>{wish?.session || `item ${number}`}</b>;
  return (
    <a href={`#/session/${encodeURIComponent(session)}`}>
      <b>{session}</b>
    </a>
  );
}

/** Desktop notices, while this page is open. */
function useNotices(items: readonly QueueItemJson[] | undefined, wanted: boolean): void {
  const before = useRef(items);
  useEffect(() => {
    if (wanted && before.current && items)
      for (const text of notices(before.current, items)) new Notification("Glasswing", { body: text });
    before.current = items;
  }, [items, wanted]);
}

function Buttons({ item, items, act, busy }: { item: QueueItemJson; items: readonly QueueItemJson[]; act: Act; busy: boolean }) {
  const number = item.number!;
  const name = item.session || item.wish?.session || `item ${number}`;
  const [edited, setEdited] = useState(false);
  const move = (step: -1 | 1) => {
    const before = placeBeside(items, number, step);
    return (
      <button
        class="quiet"
        aria-label={`Move ${name} ${step < 0 ? "up" : "down"}`}
        disabled={busy || before === undefined}
        onClick={() => act("MoveQueueItem", { number, before })}
      >
        {step < 0 ? "↑" : "↓"}
      </button>
    );
  };
  return (
    <div class="row">
      {waits(item) && (
        <>
          {move(-1)}
          {move(1)}
          {item.wish?.approval && !item.approvedBy && (
            <button class="primary" disabled={busy} onClick={() => act("ApproveQueueItem", { number })}>
              Approve
            </button>
          )}
          <button disabled={busy} onClick={() => act("RunQueueItem", { number })}>
            Run next
          </button>
          <button disabled={busy} onClick={() => setEdited(true)}>
            Edit…
          </button>
          {edited && <EditDialog item={item} close={() => setEdited(false)} />}
        </>
      )}
      <button
        disabled={busy}
        onClick={() => act("DuplicateQueueItem", { requestId: crypto.randomUUID(), number })}
      >
        {isUnusual(item) ? "Capture again" : "Duplicate"}
      </button>
      {item.state !== "QUEUE_ITEM_STATE_RUNNING" && (
        <button disabled={busy} onClick={() => act("RemoveQueueItem", { number })}>
          Remove
        </button>
      )}
    </div>
  );
}

function Item({ item, items, act, busy }: { item: QueueItemJson; items: readonly QueueItemJson[]; act: Act; busy: boolean }) {
  const [kind, word] = kStates[item.state!] ?? ["faint", "unknown"];
  const number = item.number!;
  const isDragged = mayOperate.value && waits(item);
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    const dragged = event.dataTransfer?.getData("text/plain") ?? "";
    const before = placeOf(items, dragged, number);
    if (before !== undefined) act("MoveQueueItem", { number: dragged, before });
  };
  return (
    <li
      class={isDragged ? "item dragged" : "item"}
      draggable={isDragged}
      onDragStart={(event: DragEvent) => event.dataTransfer?.setData("text/plain", number)}
      onDragOver={(event: DragEvent) => waits(item) && event.preventDefault()}
      onDrop={drop}
    >
      <div class="row">
        <span class="digits note">{number}</span>
        <Name item={item} />
        <State kind={kind}>{word}</State>
        <span class="note">
          {item.addedBy && `of ${item.addedBy}`}
          {(item.tries ?? 0) > 1 && `, tried ${item.tries} times`}
        </span>
        <span class="spacer" />
        {mayOperate.value && <Buttons item={item} items={items} act={act} busy={busy} />}
      </div>
      {item.reason && (
        <span class={item.ended ? "caution-text" : "note"}>
          <Message text={item.reason} />
        </span>
      )}
    </li>
  );
}

export default function Page() {
  const [ended, setEnded] = useState(true);
  const [wanted, setWanted] = useState(false);
  const [turn, setTurn] = useState(0); // asks again at once after a change
  const { busy, error: refused, act } = useAction();
  const { value, live, error } = useFeed(
    (signal) => polled<GetQueueResponseJson>("QueueService/GetQueue", { ended }, 1, { signal }),
    [ended, turn],
  );
  const change: Act = (method, request) =>
    void act(() => call(`QueueService/${method}`, request)).then(() => setTurn((old) => old + 1));
  const items = value?.items ?? [];
  const holds = value?.queue?.holds ?? [];
  useNotices(value?.items, wanted);
  const running = value?.queue?.running ?? false;
  return (
    <div class={live || !value ? "queue" : "queue stale"}>
      <div class="row">
        <h1>Queue</h1>
        {value && <State kind={running ? "busy" : "paused"}>{running ? "runs" : "is paused"}</State>}
        {value?.queue?.by && <span class="note">by {value.queue.by}</span>}
        <span class="spacer" />
        <label>
          <input type="checkbox" checked={ended} onChange={() => setEnded(!ended)} /> with what has ended
        </label>
        <label>
          <input
            type="checkbox"
            checked={wanted}
            disabled={!("Notification" in globalThis)}
            onChange={() =>
              void (wanted ? Promise.resolve("denied") : Notification.requestPermission()).then((may) => setWanted(may === "granted"))
            }
          />{" "}
          desktop notices
        </label>
        {value && mayOperate.value && (
          <button class="primary" disabled={busy} onClick={() => change("SetQueue", { running: !running })}>
            {running ? "Pause after this item" : "Start"}
          </button>
        )}
      </div>
      {!live && error !== undefined && <FeedFailure error={error} />}
      {refused !== undefined && (
        <p class="failure" role="alert">
          {errorText(refused)}
        </p>
      )}
      {holds.map(({ number, from, to, why, by }) => (
        <p key={number} class="row">
          Held for people from {timeText(from ?? "")} to {timeText(to ?? "")}
          {why && `: ${why}`} <span class="note">{by && `by ${by}`}</span>
          {mayOperate.value && (
            <button class="quiet" disabled={busy} onClick={() => change("ReleaseQueue", { number })}>
              Free again
            </button>
          )}
        </p>
      ))}
      {value && (
        <section class="card">
          {items.length === 0 ? (
            <p class="note">
              The queue is empty. Add captures with <code>glasswing queue add PLAN</code>.
            </p>
          ) : (
            <ul class="items">
              {items.map((item) => (
                <Item key={item.number} item={item} items={items} act={change} busy={busy} />
              ))}
            </ul>
          )}
        </section>
      )}
    </div>
  );
}
