import { useEffect, useRef, useState } from "preact/hooks";
import { mayOperate, stream } from "../api";
import type { ShowPatternResponseJson } from "../gen/glasswing/v1/rig_service_pb";
import { Failure } from "../parts/failure";
import { useAction } from "../parts/use_action";

const kPatterns = ["white", "gray", "bars", "lines", "ramp", "black"];

/** Shows a test pattern on all monitors until stopped or the page is left. */
export function Pattern() {
  const [pattern, setPattern] = useState("white");
  const [shown, setShown] = useState<string[]>();
  const { busy, error, act } = useAction();
  const cancel = useRef<AbortController | undefined>(undefined);
  useEffect(() => () => cancel.current?.abort(), []);
  if (!mayOperate.value) return null;
  const show = async (): Promise<void> => {
    cancel.current = new AbortController();
    const { signal } = cancel.current;
    try {
      for await (const { monitors } of stream<ShowPatternResponseJson>("RigService/ShowPattern", { pattern }, { signal }))
        setShown(monitors ?? []);
    } catch (reason) {
      if (!signal.aborted) throw reason;
    } finally {
      setShown(undefined);
    }
  };
  return (
    <section id="pattern" class="card">
      <div class="row">
        <h2>Test pattern</h2>
        <label>
          Pattern
          <select value={pattern} disabled={busy} onChange={(event) => setPattern(event.currentTarget.value)}>
            {kPatterns.map((name) => (
              <option key={name}>{name}</option>
            ))}
          </select>
        </label>
        <button onClick={() => (busy ? cancel.current?.abort() : void act(show))}>{busy ? "Stop" : "Show"}</button>
        <span class="note" role="status">
          {shown ? `${pattern} on ${shown.join(", ")}` : "The rig is reserved while a pattern is shown."}
        </span>
      </div>
      {error !== undefined && <Failure error={error} />}
    </section>
  );
}
