import { useState } from "preact/hooks";
import { call, mayOperate } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { Failure } from "../parts/failure";
import { useAction } from "../parts/use_action";

/** The note and the tags; operators can change them. */
export function Annotations({ session }: { session: SessionJson }) {
  const { name = "", note = "", tags = [] } = session;
  const [draft, setDraft] = useState<string>();
  const [tag, setTag] = useState("");
  const { busy, error, act } = useAction();
  const annotate = (change: object) => act(() => call("SessionService/AnnotateSession", { name, ...change }));
  if (!mayOperate.value) {
    if (!note && tags.length === 0) return null;
    return (
      <section class="card annotations">
        <h2>Note and tags</h2>
        {note && <p>{note}</p>}
        <div class="row">
          {tags.map((each) => (
            <span key={each} class="tag">
              {each}
            </span>
          ))}
        </div>
      </section>
    );
  }
  const save = async (event: Event): Promise<void> => {
    event.preventDefault();
    if (await annotate({ note: draft ?? note })) setDraft(undefined);
  };
  const add = async (event: Event): Promise<void> => {
    event.preventDefault();
    if (tag && (await annotate({ addTags: [tag] }))) setTag("");
  };
  return (
    <section class="card annotations">
      <h2>Note and tags</h2>
      <form onSubmit={(event) => void save(event)}>
        <textarea
          rows={2}
          maxLength={4096}
          aria-label="Note"
          placeholder="Note"
          value={draft ?? note}
          onInput={(event) => setDraft(event.currentTarget.value)}
        />
        {draft !== undefined && draft !== note && (
          <div class="row">
            <button class="primary" disabled={busy}>
              Save the note
            </button>
            <button type="button" onClick={() => setDraft(undefined)}>
              Undo
            </button>
          </div>
        )}
      </form>
      <form class="row" onSubmit={(event) => void add(event)}>
        {tags.map((each) => (
          <span key={each} class="tag">
            {each}
            <button
              type="button"
              class="quiet"
              aria-label={`Remove the tag ${each}`}
              disabled={busy}
              onClick={() => void annotate({ removeTags: [each] })}
            >
              ×
            </button>
          </span>
        ))}
        <input
          class="short"
          type="text"
          pattern="[A-Za-z0-9._\-]{1,64}"
          title="Letters, digits, dots, dashes and underscores"
          aria-label="New tag"
          placeholder="new tag"
          value={tag}
          onInput={(event) => setTag(event.currentTarget.value)}
        />
        <button disabled={busy || tag === ""}>Add</button>
      </form>
      {error !== undefined && <Failure error={error} />}
    </section>
  );
}
