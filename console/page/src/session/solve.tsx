import { useEffect, useState } from "preact/hooks";
import { call } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type {
  ListMethodsResponseJson,
  SolveMethodJson,
  SolveOptionJson,
} from "../gen/glasswing/v1/session_service_pb";
import { Dialog } from "../parts/dialog";
import { FormEnd } from "../parts/form_end";
import { useAction } from "../parts/use_action";

const isSwitch = (option: SolveOptionJson): boolean =>
  option.whole === true && (option.low ?? 0) === 0 && option.high === 1;

/** One option of a method. Empty: its default. */
function OptionField({
  option,
  value,
  set,
}: {
  option: SolveOptionJson;
  value: string;
  set: (value: string) => void;
}) {
  const choices = isSwitch(option) ? ["0", "1"] : (option.choices ?? []);
  const more = option.onlyWith === undefined ? "" : `; only with ${option.onlyWith}`;
  return (
    <label title={`${option.help ?? ""}${more}`}>
      {option.name}
      {choices.length > 0 ? (
        <select value={value} onChange={(event) => set(event.currentTarget.value)}>
          <option value="">{`default: ${option.usual ?? ""}`}</option>
          {choices.map((choice) => (
            <option key={choice}>{choice}</option>
          ))}
        </select>
      ) : (
        <input
          type="number"
          min={option.low ?? 0}
          max={option.high}
          step={option.whole ? 1 : "any"}
          placeholder={`${option.usual ?? ""} (${option.low ?? 0} to ${option.high ?? 0})`}
          value={value}
          onInput={(event) => set(event.currentTarget.value)}
        />
      )}
    </label>
  );
}

export function SolveDialog({ session, close }: { session: SessionJson; close: () => void }) {
  const [method, setMethod] = useState("");
  const [methods, setMethods] = useState<SolveMethodJson[]>([]);
  const [values, setValues] = useState<Record<string, string>>({});
  const { busy, error, act } = useAction();
  const chosen = method || session.plan?.method;
  const options = methods.find(({ name }) => name === chosen)?.options ?? [];
  useEffect(() => {
    void act(async () => {
      const listed = await call<ListMethodsResponseJson>("SessionService/ListMethods");
      setMethods(listed.methods ?? []);
    });
  }, []);
  const solve = async (event: Event): Promise<void> => {
    event.preventDefault();
    const given = Object.fromEntries(
      options.map(({ name = "" }) => [name, values[name] ?? ""]).filter(([, value]) => value !== ""),
    ) as Record<string, string>;
    const asked = async (): Promise<unknown> =>
      call("SessionService/SolveSession", { name: session.name, method, options: given });
    if (await act(asked)) close();
  };
  return (
    <Dialog title={`Solve ${session.name ?? ""}`} close={close}>
      <form class="fields" onSubmit={(event) => void solve(event)}>
        <label>
          Method
          <select value={method} onChange={(event) => setMethod(event.currentTarget.value)}>
            <option value="">the plan's ({session.plan?.method || "chosen by its frames"})</option>
            {methods.map(({ name }) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </label>
        {options.map((option) => (
          <OptionField
            key={`${chosen ?? ""} ${option.name ?? ""}`}
            option={option}
            value={values[option.name ?? ""] ?? ""}
            set={(value) => setValues({ ...values, [option.name ?? ""]: value })}
          />
        ))}
        {session.matteReady && (
          <p class="note">The current matte stays available until the new one is done.</p>
        )}
        <FormEnd action="Solve" busy={busy} error={error} close={close} />
      </form>
    </Dialog>
  );
}
