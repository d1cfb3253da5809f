import { useState } from "preact/hooks";
import { mayOperate } from "../api";
import type { ListSessionsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { FeedFailure } from "../parts/silence";
import { polled, useFeed } from "../parts/feed";
import { plainName } from "../parts/words";
import { ImportDialog, useDrop } from "./import";
import type { Files } from "./import_archive";
import { clicked, kNewestFirst, ordered, startOfDay, type Column } from "./order";
import { kHeads, SessionTable } from "./session_table";
import { isCalibration, kStateNames } from "./states";

const kMaxShown = 200;
const kAges: [days: number, text: string][] = [
  [0, "today"],
  [6, "the last 7 days"],
  [29, "the last 30 days"],
];

export function List() {
  const [text, setText] = useState("");
  const [state, setState] = useState("");
  const [tag, setTag] = useState("");
  const [age, setAge] = useState("");
  const [order, setOrder] = useState(kNewestFirst);
  const [importing, setImporting] = useState<{ dropped?: Promise<Files> }>();
  const drop = useDrop((dropped) => setImporting({ dropped }));
  const request = {
    text,
    tags: tag ? [tag] : [],
    states: state ? [state] : [],
    createdFrom: age === "" ? "" : startOfDay(Number(age)),
  };
  const { value, live, error } = useFeed(
    (signal) => polled<ListSessionsResponseJson>("SessionService/ListSessions", request, 2, { signal }),
    [text, state, tag, age],
  );
  const sessions = ordered((value?.sessions ?? []).filter((each) => !isCalibration(each)), order);
  return (
    <div class={drop.over ? "session dropping" : "session"} {...(mayOperate.value ? drop.handlers : {})}>
      <div class="row">
        <h1>Sessions</h1>
        <span class="spacer" />
        {mayOperate.value && (
          <>
            <button onClick={() => setImporting({})}>Import…</button>
            <a class="button primary" href="#/session/+new">
              New session
            </a>
          </>
        )}
      </div>
      {importing && <ImportDialog dropped={importing.dropped} close={() => setImporting(undefined)} />}
      <section class={live || !value ? "card" : "card stale"}>
        <div class="row">
          <label>
            Search
            <input
              type="search"
              value={text}
              placeholder="name, note, tag"
              onInput={(event) => setText(event.currentTarget.value)}
            />
          </label>
          <label>
            State
            <select value={state} onChange={(event) => setState(event.currentTarget.value)}>
              <option value="">any</option>
              {kStateNames.map((name) => (
                <option key={name} value={name}>
                  {plainName(name, "SESSION_STATE_")}
                </option>
              ))}
            </select>
          </label>
          <label>
            Begun
            <select value={age} onChange={(event) => setAge(event.currentTarget.value)}>
              <option value="">any time</option>
              {kAges.map(([days, title]) => (
                <option key={days} value={days}>
                  {title}
                </option>
              ))}
            </select>
          </label>
          <label class="narrow-only">
            Sort by
            <select
              value={order.column}
              onChange={(event) => setOrder(clicked(order, event.currentTarget.value as Column))}
            >
              {kHeads.map(([column, title]) => (
                <option key={column} value={column}>
                  {title.toLowerCase()}
                </option>
              ))}
            </select>
          </label>
          {tag && (
            <button class="tag" onClick={() => setTag("")} title="Sessions with any tags again">
              {tag} ×
            </button>
          )}
        </div>
        {!live && <FeedFailure error={error} />}
        {value && sessions.length === 0 && (
          <p>{text || state || tag || age ? "No session matches." : "There is no session yet."}</p>
        )}
        {sessions.length > 0 && (
          <SessionTable sessions={sessions.slice(0, kMaxShown)} order={order} setOrder={setOrder} search={setTag} />
        )}
        {sessions.length > kMaxShown && (
          <p class="note">{sessions.length - kMaxShown} more are not listed: narrow the search.</p>
        )}
      </section>
    </div>
  );
}
