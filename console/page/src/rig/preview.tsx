import { useEffect, useRef, useState } from "preact/hooks";
import { call, stream } from "../api";
import type { GetCameraResponseJson, PreviewResponseJson } from "../gen/glasswing/v1/camera_service_pb";
import { Chart } from "../parts/chart";
import { FeedFailure } from "../parts/silence";
import { follow } from "../parts/feed";
import { Message } from "../parts/message";
import { save } from "../parts/save";
import { State } from "../parts/state";
import { Histogram } from "./histogram_view";
import { drawPeaking, drawZebra, histogram } from "./picture_figures";
import { preparationText } from "./preparation";

interface Settings {
  exposureMs: number;
  maxFps: number;
  maxWidthPx: number;
}

interface Seen {
  picture: PreviewResponseJson;
  counts: Uint32Array;
}

const kFocusSeconds = 30;
const kMaxWidth_px = 4096; // of a preview: more than most cameras have

function jpegOf({ jpeg = "" }: PreviewResponseJson): Blob {
  const bytes = Uint8Array.from(atob(jpeg), (letter) => letter.charCodeAt(0));
  return new Blob([bytes], { type: "image/jpeg" });
}

/** Follows the camera's preview while `on`; draws each picture on the canvas. */
function usePreview(
  node: string | undefined,
  on: boolean,
  settings: Settings,
  overlays: { zebra: boolean; peaking: boolean },
  end: () => void,
) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const drawn = useRef(overlays);
  drawn.current = overlays;
  const [seen, setSeen] = useState<Seen>();
  const [live, setLive] = useState(false);
  const [preparation, setPreparation] = useState<PreviewResponseJson["preparation"]>();
  const [error, setError] = useState<unknown>();
  const [focus, setFocus] = useState<[number[], (number | null)[]]>([[], []]);
  useEffect(() => {
    if (!on || node === undefined) return;
    setError(undefined);
    setFocus([[], []]);
    const cancel = new AbortController();
    const show = async (picture: PreviewResponseJson): Promise<void> => {
      const image = await createImageBitmap(jpegOf(picture));
      const pen = canvas.current?.getContext("2d", { willReadFrequently: true });
      if (!pen || cancel.signal.aborted) return;
      [pen.canvas.width, pen.canvas.height] = [image.width, image.height];
      pen.drawImage(image, 0, 0);
      image.close();
      const pixels = pen.getImageData(0, 0, pen.canvas.width, pen.canvas.height);
      const counts = histogram(pixels);
      if (drawn.current.peaking) drawPeaking(pixels);
      if (drawn.current.zebra) drawZebra(pixels);
      if (drawn.current.peaking || drawn.current.zebra) pen.putImageData(pixels, 0, 0);
      const now = Date.now() / 1000;
      setSeen({ picture, counts });
      setFocus(([times, values]) => {
        const from = Math.max(
          0,
          times.findIndex((time) => time > now - kFocusSeconds),
        );
        return [
          [...times.slice(from), now],
          [...values.slice(from), picture.focusHint ? null : Number(picture.focus ?? 0)],
        ];
      });
    };
    const tell = (change: { value: PreviewResponseJson } | { error: unknown; last: boolean }): void => {
      const preparing = "value" in change ? change.value.preparation : undefined;
      setPreparation(preparing);
      setLive("value" in change && !preparing);
      setError("error" in change ? change.error : undefined);
      if (preparing) return;
      if ("value" in change) void show(change.value);
      else if (change.last) end();
    };
    void follow(
      (signal) => stream<PreviewResponseJson>("CameraService/Preview", settings, { node, signal }),
      tell,
      cancel.signal,
    );
    return () => (cancel.abort(), setLive(false), setPreparation(undefined));
  }, [node, on, settings.exposureMs, settings.maxFps, settings.maxWidthPx]);
  return { canvas, seen, live, preparation, error, focus };
}

function useCamera(node: string | undefined): GetCameraResponseJson | undefined {
  const [camera, setCamera] = useState<GetCameraResponseJson>();
  useEffect(() => {
    if (node !== undefined)
      call<GetCameraResponseJson>("CameraService/GetCamera", {}, { node }).then(setCamera, () =>
        setCamera(undefined),
      );
  }, [node]);
  return camera;
}

function Figures({ picture }: { picture: PreviewResponseJson }) {
  const clipped = Number(picture.clippedFraction ?? 0);
  return (
    <dl class="figures">
      <div>
        <dt>Exposure</dt>
        <dd>{Number(picture.exposureMs ?? 0).toPrecision(3)} ms</dd>
      </div>
      {picture.gain !== undefined && (
        <div title="Set where the camera node is started (--gain); calibrations are of one gain">
          <dt>Gain</dt>
          <dd>{Number(Number(picture.gain).toPrecision(3))}</dd>
        </div>
      )}
      <div>
        <dt>Mean light</dt>
        <dd>{(100 * Number(picture.mean ?? 0)).toFixed(1)} %</dd>
      </div>
      <div>
        <dt>Clipped</dt>
        <dd class={clipped > 0.001 ? "caution-text" : ""}>{(100 * clipped).toFixed(2)} %</dd>
      </div>
      <div>
        <dt>Focus</dt>
        <dd>{picture.focusHint ? "–" : Number(picture.focus ?? 0).toFixed(2)}</dd>
      </div>
    </dl>
  );
}

export function Preview({ cameras }: { cameras: string[] }) {
  const [chosen, setChosen] = useState<string>();
  const node = chosen ?? cameras[0];
  const [on, setOn] = useState(false);
  const [settings, setSettings] = useState<Settings>({ exposureMs: 4, maxFps: 5, maxWidthPx: 640 });
  const [zebra, setZebra] = useState(false);
  const [peaking, setPeaking] = useState(false);
  const [actual, setActual] = useState(false);
  const camera = useCamera(node);
  const { canvas, seen, live, preparation, error, focus } = usePreview(
    node,
    on,
    settings,
    { zebra, peaking },
    () => setOn(false),
  );
  const waitsFor = preparation
    ? `the camera is not ready: ${preparationText(preparation)}`
    : "waiting for the camera";
  const change = (part: Partial<Settings>): void => setSettings((old) => ({ ...old, ...part }));
  return (
    <section class="card preview">
      <div class="row">
        <h2>What the camera sees</h2>
        {on &&
          (live ? (
            <State kind="good">live</State>
          ) : (
            <State kind="caution">{seen ? `not live: ${waitsFor}` : waitsFor}</State>
          ))}
        {seen?.picture.widthPx && (
          <span class="note digits">
            {seen.picture.widthPx}×{seen.picture.heightPx}
          </span>
        )}
      </div>
      <div class="preview-body">
        <div
          class={`screen${on && live ? "" : " waiting"}${actual ? " actual" : ""}`}
          tabIndex={actual && seen ? 0 : undefined}
        >
          <canvas ref={canvas} role="img" aria-label="The camera's picture" hidden={!seen} />
          {!seen && (
            <p class="note">
              {node === undefined
                ? "No camera has registered with the server."
                : "Start the preview to point and focus the camera. A capture takes precedence."}
            </p>
          )}
        </div>
        <div class="preview-side">
          <FeedFailure error={error} />
          <div class="row controls">
            <button class="primary" disabled={node === undefined} onClick={() => setOn(!on)}>
              {on ? "Stop" : "Start"}
            </button>
            {cameras.length > 1 && (
              <label>
                Camera
                <select value={node} onChange={(event) => setChosen(event.currentTarget.value)}>
                  {cameras.map((name) => (
                    <option key={name}>{name}</option>
                  ))}
                </select>
              </label>
            )}
            <label>
              Exposure
              <input
                class="short"
                type="number"
                step="any"
                min={camera?.minExposureMs?.toString() ?? 0.01}
                max={camera?.maxExposureMs?.toString() ?? 10000}
                value={settings.exposureMs}
                onChange={(event) => change({ exposureMs: Number(event.currentTarget.value) || 0 })}
              />{" "}
              ms
            </label>
            <label>
              Rate
              <select
                value={settings.maxFps}
                onChange={(event) => change({ maxFps: Number(event.currentTarget.value) })}
              >
                {[1, 2, 5, 10].map((fps) => (
                  <option key={fps} value={fps}>
                    {fps} a second
                  </option>
                ))}
              </select>
            </label>
            <label>
              Width
              <select
                value={settings.maxWidthPx}
                onChange={(event) => change({ maxWidthPx: Number(event.currentTarget.value) })}
              >
                {[320, 640, 1280, 2560, kMaxWidth_px].map((width) => (
                  <option key={width} value={width}>
                    {width === kMaxWidth_px ? "the camera's" : `${width} px`}
                  </option>
                ))}
              </select>
            </label>
            <label title="A pixel of the picture for a pixel of the screen; scroll to see the rest">
              <input
                type="checkbox"
                checked={actual}
                onChange={(event) => setActual(event.currentTarget.checked)}
              />
              Actual size
            </label>
            <label>
              <input
                type="checkbox"
                checked={zebra}
                onChange={(event) => setZebra(event.currentTarget.checked)}
              />
              Mark clipped areas
            </label>
            <label>
              <input
                type="checkbox"
                checked={peaking}
                onChange={(event) => setPeaking(event.currentTarget.checked)}
              />
              Mark sharp edges
            </label>
          </div>
          {seen && (
            <>
              <Figures picture={seen.picture} />
              <div>
                <button onClick={() => save(jpegOf(seen.picture), `${node}.jpg`)}>Save this picture</button>
              </div>
              <Histogram counts={seen.counts} />
              {focus[0].length > 1 && (
                <Chart
                  label="Focus over the last seconds; higher is sharper"
                  data={focus}
                  lines={[{ label: "focus", token: "--accent" }]}
                  text={(value) => value.toFixed(2)}
                  height={110}
                />
              )}
              <p class="note" role="status">
                {seen.picture.focusHint ? (
                  <Message text={`Focus: ${seen.picture.focusHint}.`} />
                ) : (
                  "Focus: 1 is an edge as sharp as the pixels, 0.5 one that is blurred by about a pixel."
                )}
              </p>
            </>
          )}
        </div>
      </div>
    </section>
  );
}
