import { useState } from "preact/hooks";
import { call } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { Dialog } from "../parts/dialog";
import { Failure } from "../parts/failure";
import { useAction } from "../parts/use_action";

const kMethods = ["gaussian", "hierarchical", "fringe", "alpha", "ramp"];

/** "modes=2 images=100" as a map, by the rule of parse_setting (core/pattern/method_options.h): a name is needed. */
export function parseOptions(text: string): Record<string, string> {
  return Object.fromEntries(
    text
      .split(/[\s,]+/)
      .filter(Boolean)
      .map((part) => {
        const [, name, value] = /^([^=]+)=(.*)$/.exec(part) ?? [];
        if (name === undefined || value === undefined)
          throw new Error(`"${part}" is no option; write them as modes=2 images=100`);
        return [name, value];
      }),
  );
}

export function SolveDialog({ session, close }: { session: SessionJson; close: () => void }) {
  const [method, setMethod] = useState("");
  const [options, setOptions] = useState("");
  const { busy, error, act } = useAction();
  const solve = async (event: Event): Promise<void> => {
    event.preventDefault();
    const asked = async (): Promise<unknown> =>
      call("SessionService/SolveSession", { name: session.name, method, options: parseOptions(options) });
    if (await act(asked)) close();
  };
  return (
    <Dialog title={`Solve ${session.name ?? ""}`} close={close}>
      <form class="fields" onSubmit={(event) => void solve(event)}>
        <label>
          Method
          <select value={method} onChange={(event) => setMethod(event.currentTarget.value)}>
            <option value="">the plan's ({session.plan?.method || "by its frames"})</option>
            {kMethods.map((name) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </label>
        <label>
          Options
          <input
            type="text"
            placeholder="modes=2 images=100"
            value={options}
            onInput={(event) => setOptions(event.currentTarget.value)}
          />
        </label>
        {session.matteReady && (
          <p class="note">The present matte can be fetched until the new one is done.</p>
        )}
        {error !== undefined && <Failure error={error} />}
        <div class="row ends">
          <button type="button" onClick={close}>
            Not now
          </button>
          <button class="primary" disabled={busy}>
            Solve
          </button>
        </div>
      </form>
    </Dialog>
  );
}
