import { useState } from "preact/hooks";
import { call, mayOperate } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { ListSessionsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { Confirm } from "../parts/confirm";
import { FeedFailure } from "../parts/silence";
import { polled, useFeed } from "../parts/feed";
import { State } from "../parts/state";
import { bytesText, countText, errorText, plainName, timeText } from "../parts/words";
import { sizeText } from "./controls";
import { ImportDialog, useDrop } from "./import";
import type { Files } from "./import_archive";
import { clicked, kNewestFirst, ordered, startOfDay, type Column, type Order } from "./order";
import { allows, kindOf, kStateNames, progressOf } from "./states";
import { Thumbnail } from "./thumbnail";

const kMaxShown = 200;
const kHeads: [Column, string][] = [
  ["name", "Session"],
  ["state", "State"],
  ["steps", "Steps"],
  ["method", "Method"],
  ["begun", "Begun"],
  ["size", "Frames"],
];
const kAges: [days: number, text: string][] = [
  [0, "today"],
  [6, "the last 7 days"],
  [29, "the last 30 days"],
];

function stepsText(session: SessionJson): string {
  const progress = progressOf(session);
  if (progress && progress.count > 0) return `${progress.done} of ${progress.count} ${progress.what}`;
  return countText(session.stepCount ?? 0, "step");
}

/** Deletes one after the other; an error names all that stay. */
async function deleteAll(names: readonly string[]): Promise<void> {
  const failures: string[] = [];
  for (const name of names) {
    await call("SessionService/DeleteSession", { name }).catch((error: unknown) =>
      failures.push(`${name}: ${errorText(error)}`),
    );
  }
  if (failures.length > 0)
    throw new Error(`${failures.length} of ${names.length} were not deleted. ${failures.join("; ")}`);
}

function DeleteSelected({ sessions, clear }: { sessions: readonly SessionJson[]; clear: () => void }) {
  const [asked, setAsked] = useState(false);
  const bytes = sessions.reduce((sum, { archiveBytes }) => sum + Number(archiveBytes ?? 0), 0);
  const names = sessions.map(({ name = "" }) => name);
  const what = countText(names.length, "session");
  return (
    <div class="row">
      <b role="status">{what} selected</b>
      <button class="danger" onClick={() => setAsked(true)}>
        Delete {what}…
      </button>
      <button class="quiet" onClick={clear}>
        Select none
      </button>
      {asked && (
        <Confirm
          title={`Delete ${what}?`}
          action={`Delete ${what}`}
          run={() => deleteAll(names)}
          done={clear}
          close={() => setAsked(false)}
        >
          <p>
            Their frames ({bytesText(bytes)}) and mattes are removed for good: {names.join(", ")}.
          </p>
        </Confirm>
      )}
    </div>
  );
}

interface RowProps {
  session: SessionJson;
  search: (tag: string) => void;
  selected: boolean;
  /** Undefined: nothing can be selected. */
  select: ((on: boolean) => void) | undefined;
}

function Row({ session, search, selected, select }: RowProps) {
  const { name = "", note, tags = [] } = session;
  const removable = allows(session, "SESSION_ACTION_DELETE");
  return (
    <tr>
      {select && (
        <td data-label="Select">
          <input
            type="checkbox"
            aria-label={`Select ${name}`}
            title={removable ? undefined : "It cannot be deleted now"}
            disabled={!removable}
            checked={selected}
            onChange={(event) => select(event.currentTarget.checked)}
          />
        </td>
      )}
      <td data-label="Session">
        <span class="titled">
          <Thumbnail session={session} />
          <span>
            <a href={`#/session/${encodeURIComponent(name)}`}>
              <b>{name}</b>
            </a>
            {note && <span class="note clip">{note}</span>}
          </span>
        </span>
      </td>
      <td data-label="State">
        <span>
          <State kind={kindOf(session)}>{plainName(session.state, "SESSION_STATE_")}</State>
          {session.waiting && <span class="note clip">waiting: {session.waiting.what}</span>}
        </span>
      </td>
      <td data-label="Steps" class="digits">
        {stepsText(session)}
      </td>
      <td data-label="Method">{session.method || "–"}</td>
      <td data-label="Begun">{timeText(session.created ?? "")}</td>
      <td data-label="Frames" class="digits">
        {sizeText(session)}
      </td>
      <td data-label="Tags">
        <span>
          {tags.length === 0 && "–"}
          {tags.map((tag) => (
            <button key={tag} class="tag" onClick={() => search(tag)} title={`Only sessions tagged ${tag}`}>
              {tag}
            </button>
          ))}
        </span>
      </td>
    </tr>
  );
}

interface TableProps {
  sessions: readonly SessionJson[];
  order: Order;
  setOrder: (order: Order) => void;
  search: (tag: string) => void;
  chosen: ReadonlySet<string>;
  choose: (names: ReadonlySet<string>) => void;
}

function Table({ sessions, order, setOrder, search, chosen, choose }: TableProps) {
  const removable = sessions.filter((each) => allows(each, "SESSION_ACTION_DELETE")).map(({ name = "" }) => name);
  const all = removable.length > 0 && removable.every((name) => chosen.has(name));
  const selectOne = (name: string, on: boolean): void =>
    choose(new Set(on ? [...chosen, name] : [...chosen].filter((each) => each !== name)));
  return (
    <table class="stack sessions">
      <thead>
        <tr>
          {mayOperate.value && (
            <th>
              <input
                type="checkbox"
                aria-label="Select all that can be deleted"
                disabled={removable.length === 0}
                checked={all}
                onChange={(event) => choose(new Set(event.currentTarget.checked ? removable : []))}
              />
            </th>
          )}
          {kHeads.map(([column, title]) => (
            <th
              key={column}
              aria-sort={order.column === column ? (order.descending ? "descending" : "ascending") : undefined}
            >
              <button class="head" onClick={() => setOrder(clicked(order, column))}>
                {title}
                <span aria-hidden="true">
                  {order.column === column ? (order.descending ? " ▾" : " ▴") : ""}
                </span>
              </button>
            </th>
          ))}
          <th>Tags</th>
        </tr>
      </thead>
      <tbody>
        {sessions.map((session) => (
          <Row
            key={session.name}
            session={session}
            search={search}
            selected={chosen.has(session.name ?? "")}
            select={mayOperate.value ? (on) => selectOne(session.name ?? "", on) : undefined}
          />
        ))}
      </tbody>
    </table>
  );
}

export function List() {
  const [text, setText] = useState("");
  const [state, setState] = useState("");
  const [tag, setTag] = useState("");
  const [age, setAge] = useState("");
  const [order, setOrder] = useState(kNewestFirst);
  const [chosen, setChosen] = useState<ReadonlySet<string>>(new Set());
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
  const sessions = ordered(value?.sessions ?? [], order);
  const shown = sessions.slice(0, kMaxShown);
  // Those that are gone, or not listed any more, are not deleted.
  const selected = shown.filter(
    (each) => chosen.has(each.name ?? "") && allows(each, "SESSION_ACTION_DELETE"),
  );
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
        {selected.length > 0 && <DeleteSelected sessions={selected} clear={() => setChosen(new Set())} />}
        {sessions.length > 0 && (
          <Table
            sessions={shown}
            order={order}
            setOrder={setOrder}
            search={setTag}
            chosen={new Set(selected.map(({ name = "" }) => name))}
            choose={setChosen}
          />
        )}
        {sessions.length > kMaxShown && (
          <p class="note">{sessions.length - kMaxShown} more are not listed: narrow the search.</p>
        )}
      </section>
    </div>
  );
}
