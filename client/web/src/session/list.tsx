import { useState } from "preact/hooks";
import { mayOperate } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { ListSessionsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { FeedFailure } from "../parts/silence";
import { polled, useFeed } from "../parts/feed";
import { State } from "../parts/state";
import { plainName, timeText } from "../parts/words";
import { sizeText } from "./controls";
import { kindOf, kStateNames, progressOf } from "./states";

const kMaxShown = 200;

function stepsText(session: SessionJson): string {
  const progress = progressOf(session);
  if (progress && progress.count > 0) return `${progress.done} of ${progress.count} ${progress.what}`;
  return `${session.stepCount ?? 0} steps`;
}

function Row({ session, search }: { session: SessionJson; search: (tag: string) => void }) {
  const { name = "", note, tags = [] } = session;
  return (
    <tr>
      <td data-label="Session">
        <span>
          <a href={`#/session/${encodeURIComponent(name)}`}>
            <b>{name}</b>
          </a>
          {note && <span class="note clip">{note}</span>}
        </span>
      </td>
      <td data-label="State">
        <span>
          <State kind={kindOf(session)}>{plainName(session.state, "SESSION_STATE_")}</State>
          {session.waiting && <span class="note clip">waits: {session.waiting.what}</span>}
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
          {tags.map((tag) => (
            <button key={tag} class="tag" onClick={() => search(tag)} title="Those that have this tag">
              {tag}
            </button>
          ))}
        </span>
      </td>
    </tr>
  );
}

export function List() {
  const [text, setText] = useState("");
  const [state, setState] = useState("");
  const [tag, setTag] = useState("");
  const request = { text, tags: tag ? [tag] : [], states: state ? [state] : [] };
  const { value, live, error } = useFeed(
    (signal) => polled<ListSessionsResponseJson>("SessionService/ListSessions", request, 2, { signal }),
    [text, state, tag],
  );
  const sessions = value?.sessions ?? [];
  return (
    <div class="session">
      <div class="row">
        <h1>Sessions</h1>
        <span class="spacer" />
        {mayOperate.value && (
          <a class="button primary" href="#/session/+new">
            New session
          </a>
        )}
      </div>
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
          {tag && (
            <button class="tag" onClick={() => setTag("")} title="Any tag again">
              {tag} ×
            </button>
          )}
        </div>
        {!live && <FeedFailure error={error} />}
        {value && sessions.length === 0 && (
          <p>{text || state || tag ? "No session matches." : "There is no session yet."}</p>
        )}
        {sessions.length > 0 && (
          <table class="stack">
            <thead>
              <tr>
                <th>Session</th>
                <th>State</th>
                <th>Steps</th>
                <th>Method</th>
                <th>Begun</th>
                <th>Frames</th>
                <th>Tags</th>
              </tr>
            </thead>
            <tbody>
              {sessions.slice(0, kMaxShown).map((session) => (
                <Row key={session.name} session={session} search={setTag} />
              ))}
            </tbody>
          </table>
        )}
        {sessions.length > kMaxShown && (
          <p class="note">{sessions.length - kMaxShown} older ones are not listed: use the search.</p>
        )}
      </section>
    </div>
  );
}
