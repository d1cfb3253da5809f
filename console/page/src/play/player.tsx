import { useEffect, useRef, useState } from "preact/hooks";
import type { DraftJson } from "../gen/glasswing/v1/matte_pb";
import type { Drawable } from "../light/compositor";
import { loadByLevels } from "../light/load";
import { samplingOf, type Box, type MatteMetadata } from "../light/matte";
import { Failure } from "../parts/failure";
import { FrameSlider } from "../parts/frame_slider";
import { Sampling } from "../parts/sampling";
import { save } from "../parts/save";
import { countText } from "../parts/words";
import { kBuiltIn, openPicture, paint, type BuiltIn } from "./backgrounds";
import { closeUp, middleOf } from "./close_up";
import { listenToGestures } from "./gestures";
import { kStill, Stage } from "./stage";

/** A monitor's background: a built-in one, or a file by its name. */
interface Choice {
  kind: BuiltIn | "file";
  name: string;
  colour: string;
  keepShape: boolean;
}

const kFirstChoice: Choice = { kind: "landscape", name: "", colour: "#2f7d8c", keepShape: false };

interface ControlsProps {
  choice: Choice;
  paintOne: (kind: BuiltIn, colour: string) => void;
  open: (file: File) => void;
  keepShape: (kept: boolean) => void;
  reset: () => void;
}

function BackgroundControls({ choice, paintOne, open, keepShape, reset }: ControlsProps) {
  const file = useRef<HTMLInputElement>(null);
  const choose = (kind: string): void => {
    if (kind === "open") file.current?.click();
    else paintOne(kind as BuiltIn, choice.colour);
  };
  return (
    <>
      <label>
        Picture
        <select value={choice.kind} onChange={(event) => choose(event.currentTarget.value)}>
          {kBuiltIn.map((kind) => (
            <option key={kind} value={kind}>
              {kind}
            </option>
          ))}
          {choice.kind === "file" && <option value="file">{choice.name}</option>}
        </select>
      </label>
      <label class="button">
        Open a picture…
        <input
          ref={file}
          type="file"
          accept="image/*"
          onChange={(event) => {
            const chosen = event.currentTarget.files?.[0];
            if (chosen) open(chosen);
            event.currentTarget.value = "";
          }}
        />
      </label>
      {choice.kind === "colour" && (
        <label>
          Colour
          <input
            type="color"
            value={choice.colour}
            onInput={(event) => paintOne("colour", event.currentTarget.value)}
          />
        </label>
      )}
      <label title="Off: stretched over the monitor, as by glasswing composite">
        <input
          type="checkbox"
          checked={choice.keepShape}
          onChange={(event) => keepShape(event.currentTarget.checked)}
        />
        Keep proportions
      </label>
      <button onClick={reset}>Reset position</button>
    </>
  );
}

interface PlayerProps {
  session: string;
  frames: number[];
  /** The newest, until there is the finished matte. */
  draft: DraftJson | undefined;
}

export function Player({ session, frames, draft }: PlayerProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const stage = useRef<Stage | undefined>(undefined);
  const [ready, setReady] = useState(false);
  const [progress, setProgress] = useState(0);
  const [error, setError] = useState<unknown>();
  const [frame, setFrame] = useState(frames[0]);
  const [monitor, setMonitor] = useState(0);
  const [choices, setChoices] = useState<Choice[]>([]);
  const [exposure, setExposure] = useState(0);
  const [over, setOver] = useState(false);
  const [unsolved, setUnsolved] = useState(0);
  const [fill, setFill] = useState(true);
  const [seesAll, setSeesAll] = useState(true);
  const [crop, setCrop] = useState(true);
  const [metadata, setMetadata] = useState<MatteMetadata>();
  const [closer, setCloser] = useState<Box>();
  const [picking, setPicking] = useState(false);
  const whole = useRef({ width: 1, height: 1 });
  const chosen = useRef(monitor);
  chosen.current = monitor;
  const shown = useRef(closer);
  shown.current = closer;
  const drafted = draft?.imageCount;

  useEffect(() => {
    const cancel = new AbortController();
    setProgress(0);
    const show = (matte: Drawable): void => {
      setError(undefined);
      setMetadata(matte.metadata);
      setUnsolved(matte.unsolved.length);
      setSeesAll(matte.seeing.width === matte.width && matte.seeing.height === matte.height);
      if (!closer) {
        const step = samplingOf(matte.metadata);
        whole.current = { width: (matte.width - 1) * step + 1, height: (matte.height - 1) * step + 1 };
      }
      if (stage.current) return stage.current.setMatte(matte);
      const made = (stage.current = new Stage(canvas.current!, matte));
      made.setCrop(crop);
      made.monitors.forEach(({ width, height }, t) =>
        made.setPicture(t, paint("landscape", width, height, kFirstChoice.colour)),
      );
      setChoices(made.monitors.map(() => kFirstChoice));
      setReady(true);
    };
    const choice = { frame: drafted === undefined ? frame : undefined, partial: drafted !== undefined, region: closer };
    loadByLevels(session, choice, { signal: cancel.signal, report: setProgress }, show)
      .catch(setError)
      .finally(() => cancel.signal.aborted || setProgress(1));
    return () => cancel.abort();
  }, [session, frame, drafted, closer]);

  useEffect(() => () => stage.current?.close(), []);
  useEffect(() => {
    if (!ready) return;
    const lost = (): void =>
      setError(new Error("the graphics processor lost this page's context; reload the page"));
    canvas.current!.addEventListener("webglcontextlost", lost);
    const end = listenToGestures(canvas.current!, {
      get: () => stage.current!.standing(chosen.current),
      set: (standing) => stage.current!.move(chosen.current, standing),
      size: () => {
        const { width, height } = stage.current!.monitors[chosen.current]!;
        const share = stage.current!.shownShare * ((shown.current?.width ?? whole.current.width) / whole.current.width);
        return { width: share * width, height: share * height };
      },
    });
    return () => {
      canvas.current?.removeEventListener("webglcontextlost", lost);
      end();
    };
  }, [ready]);

  const change = (t: number, part: Partial<Choice>): void =>
    setChoices((all) => all.map((each, i) => (i === t ? { ...each, ...part } : each)));
  const paintOne = (kind: BuiltIn, colour: string): void => {
    const { width, height } = stage.current!.monitors[monitor]!;
    stage.current!.setPicture(monitor, paint(kind, width, height, colour));
    change(monitor, { kind, colour });
  };
  const open = (file: File): void => {
    openPicture(file, file.name, stage.current!.mostPictureSide).then((image) => {
      stage.current!.setPicture(monitor, image);
      change(monitor, { kind: "file", name: file.name });
      setError(undefined);
    }, setError);
  };
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    setOver(false);
    const file = event.dataTransfer?.files[0];
    if (file && ready) open(file);
  };
  const download = (): void => {
    const name = frame === undefined ? `${session}.png` : `${session}-${String(frame).padStart(4, "0")}.png`;
    stage.current!.picture(fill).then((picture) => save(picture, name), setError);
  };

  const lookCloser = (at: { clientX: number; clientY: number }): void => {
    setPicking(false);
    const { x, y, width, height } = stage.current!.view ?? { x: 0, y: 0, ...whole.current };
    const step = stage.current!.view ? sampling : 1;
    setCloser(closeUp(canvas.current!, at, { x: step * x, y: step * y, width: step * width, height: step * height }, whole.current));
  };
  const sampling = metadata ? samplingOf(metadata) : 1;

  const choice = choices[monitor];
  return (
    <section
      class="play"
      onDragOver={(event) => (event.preventDefault(), setOver(true))}
      onDragLeave={() => setOver(false)}
      onDrop={drop}
    >
      <div class="row">
        <h1>{session}</h1>
        {draft ? (
          <span class="note" role="status">
            A draft of {draft.imageCount ?? 0} of {draft.plannedImageCount ?? 0} images; it gets better by itself
          </span>
        ) : (
          <a href={`#/matte/${encodeURIComponent(session)}`}>View the matte</a>
        )}
        <a href="#/play">Other sessions</a>
      </div>
      {error !== undefined && <Failure error={error} />}
      {progress < 1 && <progress value={progress} aria-label="Loading the matte" />}
      <canvas
        ref={canvas}
        class={`stage${over ? " over" : ""}${picking ? " picking" : ""}`}
        tabIndex={0}
        role="application"
        aria-label={`The object of ${session} in front of a picture. Arrow keys move the picture, plus and minus scale it, 0 puts it back.`}
        hidden={!ready}
        onClick={(event) => picking && lookCloser(event)}
        onKeyDown={(event) => picking && event.key === "Enter" && lookCloser(middleOf(canvas.current!))}
      />
      {metadata && <Sampling metadata={metadata} />}
      {choice && (
        <div class="row card">
          {choices.length > 1 && (
            <label>
              Monitor
              <select value={monitor} onChange={(event) => setMonitor(Number(event.currentTarget.value))}>
                {stage.current!.monitors.map(({ name }, t) => (
                  <option key={name} value={t}>
                    {name}
                  </option>
                ))}
              </select>
            </label>
          )}
          <BackgroundControls
            choice={choice}
            paintOne={paintOne}
            open={open}
            keepShape={(keepShape) => {
              change(monitor, { keepShape });
              stage.current!.move(monitor, { ...stage.current!.standing(monitor), keepShape });
            }}
            reset={() => stage.current!.move(monitor, { ...kStill, keepShape: choice.keepShape })}
          />
          <label>
            Exposure
            <input
              type="range"
              min={-4}
              max={4}
              step={0.1}
              value={exposure}
              onInput={(event) => {
                const stops = Number(event.currentTarget.value);
                setExposure(stops);
                stage.current!.setExposure(stops);
              }}
            />
            <output class="digits">
              {exposure > 0 ? "+" : ""}
              {exposure.toFixed(1)}
            </output>
          </label>
          {frame !== undefined && <FrameSlider frames={frames} frame={frame} onChange={setFrame} />}
          {unsolved > 0 && (
            <label title="Pixels without a result, such as those that saw the id patch, from their neighbours">
              <input type="checkbox" checked={fill} onChange={(event) => setFill(event.currentTarget.checked)} />
              Fill {sampling > 1 ? "unsolved pixels" : countText(unsolved, "unsolved pixel")}
            </label>
          )}
          {!seesAll && (
            <label title="Without the rows and columns that see no picture on a monitor, such as its id patch">
              <input
                type="checkbox"
                checked={crop}
                onChange={(event) => {
                  setCrop(event.currentTarget.checked);
                  stage.current!.setCrop(event.currentTarget.checked);
                }}
              />
              Crop the id patch
            </label>
          )}
          {closer ? (
            <button onClick={() => setCloser(undefined)}>Whole picture</button>
          ) : (
            sampling > 1 && (
              <button aria-pressed={picking} onClick={() => setPicking(!picking)}>
                {picking ? "Click where to look closer" : "Look closer…"}
              </button>
            )
          )}
          <button class="primary" onClick={download}>
            Download frame
          </button>
        </div>
      )}
      <p class="note">
        Drop a picture here. Drag it behind the object, or use the arrow keys; wheel, pinch or + and − scale
        it.
      </p>
    </section>
  );
}
