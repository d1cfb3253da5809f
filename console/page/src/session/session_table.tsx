// Sessions with what was found in each, to be sorted, opened, selected and deleted.
import { useState } from "preact/hooks";
import { call, mayOperate } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { Confirm } from "../parts/confirm";
import { State } from "../parts/state";
import { bytesText, countText, errorText, plainName, timeText } from "../parts/words";
import { sizeText } from "./controls";
import { clicked, type Column, type Order } from "./order";
import { allows, kindOf, progressOf } from "./states";
import { Thumbnail } from "./thumbnail";

export const kHeads: [Column, string][] = [
  ["name", "Session"],
  ["state", "State"],
  ["steps", "Steps"],
  ["method", "Method"],
  ["begun", "Begun"],
  ["size", "Frames"],
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
    await call("SessionService/DeleteSession", { name, trash: true }).catch((error: unknown) =>
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
            Their frames ({bytesText(bytes)}) and mattes stay in the trash for a day: {names.join(", ")}.
          </p>
        </Confirm>
      )}
    </div>
  );
}

interface RowProps {
  session: SessionJson;
  pictured: boolean;
  search: ((tag: string) => void) | undefined;
  selected: boolean;
  /** Undefined: nothing can be selected. */
  select: ((on: boolean) => void) | undefined;
}

function Row({ session, pictured, search, selected, select }: RowProps) {
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
          {pictured && <Thumbnail session={session.views?.[0] ?? session} />}
          <span>
            <a href={`#/session/${encodeURIComponent(name)}`}>
              <b>{name}</b>
            </a>
            {session.views && <span class="note">{countText(session.views.length, "camera")}</span>}
            {note && <span class="note clip">{note}</span>}
          </span>
        </span>
      </td>
      <td data-label="State">
        <span>
          <State kind={kindOf(session)}>{plainName(session.state, "SESSION_STATE_")}</State>
          {session.waiting && <span class="note clip">waiting: {session.waiting.what}</span>}
          {session.verdict?.outlier && (
            <span class="caution-text clip" title={session.verdict.text}>
              unusual: {session.verdict.text}
            </span>
          )}
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
          {tags.map((tag) =>
            search ? (
              <button key={tag} class="tag" onClick={() => search(tag)} title={`Only sessions tagged ${tag}`}>
                {tag}
              </button>
            ) : (
              <span key={tag} class="tag">
                {tag}
              </span>
            ),
          )}
        </span>
      </td>
    </tr>
  );
}

interface TableProps {
  sessions: readonly SessionJson[];
  order: Order;
  setOrder: (order: Order) => void;
  /** With a picture of each; default: true. */
  pictured?: boolean;
  /** Finds the sessions with a tag. */
  search?: (tag: string) => void;
}

export function SessionTable({ sessions, ...how }: TableProps) {
  const [marked, setMarked] = useState<ReadonlySet<string>>(new Set());
  // Those that are gone, or not listed any more, are not deleted.
  const selected = sessions.filter((each) => marked.has(each.name ?? "") && allows(each, "SESSION_ACTION_DELETE"));
  return (
    <>
      {selected.length > 0 && <DeleteSelected sessions={selected} clear={() => setMarked(new Set())} />}
      <Table
        sessions={sessions}
        {...how}
        chosen={new Set(selected.map(({ name = "" }) => name))}
        choose={setMarked}
      />
    </>
  );
}

interface ChoiceProps extends TableProps {
  chosen: ReadonlySet<string>;
  choose: (names: ReadonlySet<string>) => void;
}

function Table({ sessions, order, setOrder, pictured = true, search, chosen, choose }: ChoiceProps) {
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
            pictured={pictured}
            search={search}
            selected={chosen.has(session.name ?? "")}
            select={mayOperate.value ? (on) => selectOne(session.name ?? "", on) : undefined}
          />
        ))}
      </tbody>
    </table>
  );
}
