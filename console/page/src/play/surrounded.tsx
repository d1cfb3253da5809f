// Rays in an environment, which is turned, brightened and replaced.
import { useEffect, useRef, useState } from "preact/hooks";
import type { Drawable } from "../light/compositor";
import type { Environment } from "../light/environment";
import { Failure } from "../parts/failure";
import { save } from "../parts/save";
import { kBuiltInEnvironments, openEnvironment, paintEnvironment, type BuiltInEnvironment } from "./environments";
import { Scene } from "./scene";
import { listenToTurns, type Facing } from "./turning";
import "./play.css";

const kFirst: Facing = { turn_deg: 0, gain: 1 };
const kMaxStops = 8;

/** What a person chose, for the next rays: where it is turned to, and the environment that was opened last. */
const kept: { facing: Facing; choice: string; own?: { name: string; picture: Environment } } = {
  facing: kFirst,
  choice: kBuiltInEnvironments[0],
};

function chosen(): Environment {
  return kept.choice === "own" && kept.own ? kept.own.picture : paintEnvironment(kept.choice as BuiltInEnvironment);
}

/** From -180 to 180. */
function halfTurns(turn_deg: number): number {
  return turn_deg - 360 * Math.round(turn_deg / 360);
}

interface SurroundedProps {
  /** For people, and the name of what is downloaded. */
  name: string;
  rays: Drawable;
  /** The angle that the camera sees across. */
  view_deg: number;
}

/** Each file of rays needs an element of its own (key). */
export function Surrounded({ name, rays, view_deg }: SurroundedProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const scene = useRef<Scene | undefined>(undefined);
  const [facing, setFacing] = useState(kept.facing);
  const [choice, setChoice] = useState(kept.choice);
  const [own, setOwn] = useState(kept.own?.name);
  const [over, setOver] = useState(false);
  const [error, setError] = useState<unknown>();

  const face = (to: Facing): void => {
    if (!scene.current) return;
    scene.current.facing = kept.facing = to;
    setFacing(to);
  };
  useEffect(() => {
    const element = canvas.current!;
    const lost = (): void => setError(new Error("the graphics processor lost this page's context; reload the page"));
    try {
      const made = (scene.current = new Scene(element, rays, kept.facing));
      made.setEnvironment(chosen());
      listenToTurns(element, view_deg, { get: () => made.facing, set: face }, kFirst);
      element.addEventListener("webglcontextlost", lost);
    } catch (reason) {
      setError(reason);
    }
    return () => {
      element.removeEventListener("webglcontextlost", lost);
      scene.current?.close();
      scene.current = undefined;
    };
  }, []);

  const choose = (kind: string): void => {
    kept.choice = kind;
    setChoice(kind);
    scene.current?.setEnvironment(chosen());
  };
  const open = async (file: File): Promise<void> => {
    if (!scene.current) return;
    canvas.current!.ariaBusy = "true";
    try {
      kept.own = { name: file.name, picture: await openEnvironment(file, file.name, scene.current.mostPictureSide) };
      choose("own");
      setOwn(file.name);
      setError(undefined);
    } catch (reason) {
      canvas.current!.ariaBusy = "false";
      setError(reason);
    }
  };
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    setOver(false);
    const file = event.dataTransfer?.files[0];
    if (file) void open(file);
  };
  const stops = Math.log2(facing.gain);
  return (
    <section
      class="play"
      aria-label="The object in an environment"
      onDragOver={(event) => (event.preventDefault(), event.stopPropagation(), setOver(true))}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => (event.stopPropagation(), drop(event))}
    >
      {error !== undefined && <Failure error={error} />}
      <canvas
        ref={canvas}
        class={`stage${over ? " over" : ""}`}
        tabIndex={0}
        role="application"
        aria-label={`The object of ${name} in an environment. Left and right arrow keys turn it, plus and minus change its light, 0 puts it back.`}
      />
      <div class="row card">
        <label>
          Environment
          <select value={choice} onChange={(event) => choose(event.currentTarget.value)}>
            {kBuiltInEnvironments.map((kind) => (
              <option key={kind} value={kind}>
                {kind}
              </option>
            ))}
            {own !== undefined && <option value="own">{own}</option>}
          </select>
        </label>
        <label class="button">
          Open an environment…
          <input
            type="file"
            accept="image/*,.hdr,.exr"
            onChange={(event) => {
              const chosen = event.currentTarget.files?.[0];
              if (chosen) void open(chosen);
              event.currentTarget.value = "";
            }}
          />
        </label>
        <label>
          Turn
          <input
            type="range"
            min={-180}
            max={180}
            step={1}
            value={halfTurns(facing.turn_deg)}
            onInput={(event) => face({ ...facing, turn_deg: Number(event.currentTarget.value) })}
          />
          <output class="digits wide-output">{halfTurns(facing.turn_deg).toFixed(0)}°</output>
        </label>
        <label>
          Light
          <input
            type="range"
            min={-kMaxStops}
            max={kMaxStops}
            step={0.25}
            value={stops}
            onInput={(event) => face({ ...facing, gain: 2 ** Number(event.currentTarget.value) })}
          />
          <output class="digits wide-output">
            {stops > 0 ? "+" : ""}
            {stops.toFixed(1)}
          </output>
        </label>
        <button onClick={() => face(kFirst)}>Put back</button>
        <button
          class="primary"
          onClick={() => void scene.current?.picture().then((picture) => save(picture, `${name}.png`), setError)}
        >
          Download frame
        </button>
      </div>
      <p class="note">
        Drop an environment here, as OpenEXR, Radiance's .hdr, or a picture: equirectangular, light from all directions. It
        stays in this browser. Drag it, or use the arrow keys; wheel or + and − change its light.
      </p>
    </section>
  );
}
