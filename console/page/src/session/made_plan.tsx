// A plan that the server makes for its rig, from what is captured and how well.
import { useEffect, useState } from "preact/hooks";
import { call } from "../api";
import type { MakePlanResponseJson } from "../gen/glasswing/v1/rig_service_pb";
import { Failure } from "../parts/failure";
import { waited } from "../parts/feed";
import { kPause_s } from "./use_plan";

const kObjects = [
  ["clear", "Clear: glass, water, crystal"],
  ["frosted", "Frosted or brushed"],
  ["metal", "Shiny, with highlights"],
  ["dark", "Dark"],
] as const;
const kQualities = [
  ["draft", "Draft: about a hundred images"],
  ["good", "Good"],
  ["best", "Best: the finest stripes, the longest capture"],
] as const;
const kMaxImages = 20000;

interface Wish {
  object: string;
  quality: string;
  imageCount: number; // 0: as many as the quality takes
  left: ReadonlySet<string>; // monitors that are left out
}

interface ChoiceProps {
  label: string;
  value: string;
  choices: readonly (readonly [string, string])[];
  onChange: (value: string) => void;
}

function Choice({ label, value, choices, onChange }: ChoiceProps) {
  return (
    <label>
      {label}
      <select value={value} onChange={(event) => onChange(event.currentTarget.value)}>
        {choices.map(([name, text]) => (
          <option key={name} value={name}>
            {text}
          </option>
        ))}
      </select>
    </label>
  );
}

/** Calls `onText` with the plan's text each time that one is made, for this camera or the only one (""). */
export function MadePlan({ camera, onText }: { camera: string; onText: (text: string) => void }) {
  const [wish, setWish] = useState<Wish>({ object: "clear", quality: "good", imageCount: 0, left: new Set() });
  const [monitors, setMonitors] = useState<readonly string[]>([]); // all of the rig
  const [error, setError] = useState<unknown>();
  const change = (part: Partial<Wish>): void => setWish({ ...wish, ...part });
  useEffect(() => {
    const cancel = new AbortController();
    const { signal } = cancel;
    const make = async (): Promise<void> => {
      await waited(kPause_s, signal);
      if (signal.aborted) return;
      const { object, quality, imageCount, left } = wish;
      const { plan, text = "" } = await call<MakePlanResponseJson>(
        "RigService/MakePlan",
        {
          purpose: "PLAN_PURPOSE_CAPTURE",
          object,
          quality,
          imageCount,
          camera,
          monitors: left.size > 0 ? monitors.filter((name) => !left.has(name)) : [],
        },
        { signal },
      );
      if (left.size === 0) setMonitors((plan?.monitors ?? []).map(({ name = "" }) => name));
      setError(undefined);
      onText(text);
    };
    make().catch((reason: unknown) => signal.aborted || setError(reason));
    return () => cancel.abort();
  }, [wish, camera]);
  const take = (name: string, used: boolean): void => {
    const left = new Set(wish.left);
    if (used) left.delete(name);
    else left.add(name);
    if (left.size < monitors.length) change({ left });
  };
  return (
    <>
      <div class="row">
        <Choice label="Object" value={wish.object} choices={kObjects} onChange={(object) => change({ object })} />
        <Choice label="Quality" value={wish.quality} choices={kQualities} onChange={(quality) => change({ quality })} />
        <label>
          Images, at most
          <input
            type="number"
            min={1}
            max={kMaxImages}
            placeholder="any"
            onInput={(event) => change({ imageCount: Number(event.currentTarget.value) })}
          />
        </label>
      </div>
      {monitors.length > 1 && (
        <fieldset class="row">
          <legend>Monitors</legend>
          {monitors.map((name) => (
            <label key={name}>
              <input
                type="checkbox"
                checked={!wish.left.has(name)}
                onChange={(event) => take(name, event.currentTarget.checked)}
              />
              {name}
            </label>
          ))}
        </fieldset>
      )}
      {error !== undefined && <Failure error={error} />}
    </>
  );
}
