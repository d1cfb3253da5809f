import { useState } from "preact/hooks";
import { call, mayOperate } from "../api";
import { Confirm } from "./confirm";
import { partsOf, type Call } from "./remedies";
import { useAction } from "./use_action";
import { errorText } from "./words";

function CallButton({ offer: { label, method, request, loss }, command }: { offer: Call; command: string }) {
  const [asked, setAsked] = useState(false);
  const [done, setDone] = useState(false);
  const { busy, error, act } = useAction();
  const run = async (): Promise<unknown> => call(method, request);
  if (done) return <b role="status">{label}: done</b>;
  return (
    <>
      <button
        type="button"
        class="inline"
        title={command}
        disabled={busy}
        onClick={() => (loss ? setAsked(true) : void act(run).then(setDone))}
      >
        {loss ? `${label}…` : label}
      </button>
      {error !== undefined && (
        <span class="failure" role="alert">
          {" "}
          {errorText(error)}
        </span>
      )}
      {asked && (
        <Confirm
          title={`${label}?`}
          action={label}
          run={run}
          done={() => setDone(true)}
          close={() => setAsked(false)}
        >
          <p>{loss}</p>
        </Confirm>
      )}
    </>
  );
}

/** A message of the server. A command in it that the console can run is a button, for operators. */
export function Message({ text }: { text: string }) {
  return (
    <>
      {partsOf(text).map(({ text: said, isCommand, call: offer, place }, i) => {
        if (!isCommand) return said;
        if (place)
          return (
            <a key={i} href={place.hash} title={said}>
              {place.label}
            </a>
          );
        return offer && mayOperate.value ? (
          <CallButton key={said} offer={offer} command={said} />
        ) : (
          <code key={i}>{said}</code>
        );
      })}
    </>
  );
}
