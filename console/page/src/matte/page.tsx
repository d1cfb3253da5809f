import { useEffect, useMemo, useState } from "preact/hooks";
import type { CaptureManifestJson } from "../gen/glasswing/v1/archive_pb";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { kMostPixels, loadMatte, matteUrl } from "../light/load";
import { kChannels, type MatteData } from "../light/matte";
import type { PageProps } from "../pages";
import { isCaptured, manifestOf } from "../parts/archive";
import { Downloads } from "../parts/downloads";
import { Failure } from "../parts/failure";
import { FrameSlider } from "../parts/frame_slider";
import { Sampling } from "../parts/sampling";
import { SessionChoice } from "../parts/session_choice";
import { framesOf, useSession } from "../parts/use_session";
import { PanelView, type Place } from "./panel_view";
import { kChannelNames, panelsOf } from "./panels";
import { Pixel } from "./pixel";
import "./matte.css";

function Viewer({ session }: { session: SessionJson }) {
  const name = session.name ?? "";
  const frames = framesOf(session);
  const [matte, setMatte] = useState<MatteData>();
  const [progress, setProgress] = useState(0);
  const [error, setError] = useState<unknown>();
  const [frame, setFrame] = useState(frames[0]);
  const [channel, setChannel] = useState(1);
  const [cursor, setCursor] = useState<Place>();
  const [shown, setShown] = useState<Place>();
  const [manifest, setManifest] = useState<Promise<CaptureManifestJson>>();

  useEffect(() => {
    const cancel = new AbortController();
    loadMatte(matteUrl(name, { frame, pixels: kMostPixels }), { signal: cancel.signal, report: setProgress })
      .then((loaded) => {
        setError(undefined);
        setMatte(loaded);
        setCursor((before) => before ?? { x: loaded.width >> 1, y: loaded.height >> 1 });
      })
      .catch(setError)
      .finally(() => cancel.signal.aborted || setProgress(1));
    return () => cancel.abort();
  }, [name, frame]);
  const panels = useMemo(() => matte && panelsOf(matte, channel), [matte, channel]);

  const choose = (place: Place, take: boolean): void => {
    setCursor(place);
    if (!take) return;
    setShown(place);
    if (!manifest && frames.length === 0) setManifest(manifestOf(session));
  };
  return (
    <section class="matte">
      <div class="row">
        <h1>{name}</h1>
        <a href={`#/play/${encodeURIComponent(name)}`}>Try backgrounds</a>
        <a href="#/matte">Other sessions</a>
        {matte?.modeChannels === 3 && (
          <label>
            Channel
            <select value={channel} onChange={(event) => setChannel(Number(event.currentTarget.value))}>
              {kChannels.map((each, c) => (
                <option key={each} value={c}>
                  {kChannelNames[each]}
                </option>
              ))}
            </select>
          </label>
        )}
        {frame !== undefined && <FrameSlider frames={frames} frame={frame} onChange={setFrame} />}
      </div>
      <Downloads
        session={name}
        captured={isCaptured(session)}
        matte="done"
        frame={frame}
        monitors={matte?.metadata.monitors.map((monitor) => monitor.name) ?? []}
      />
      {error !== undefined && <Failure error={error} />}
      {progress < 1 && <progress value={progress} aria-label="Loading the matte" />}
      {matte?.metadata.warnings?.map((warning) => (
        <p key={warning} class="note">
          {warning}
        </p>
      ))}
      {matte && <Sampling metadata={matte.metadata} />}
      <div class="panels">
        {cursor &&
          panels?.map((panel) => (
            <PanelView key={panel.name} panel={panel} cursor={cursor} choose={choose} />
          ))}
      </div>
      {matte && shown ? (
        <Pixel matte={matte} session={name} frame={frame} x={shown.x} y={shown.y} manifest={manifest} />
      ) : (
        <p class="note">
          Click a pixel, or move the cursor of a panel with the arrow keys and press Enter to see its
          footprints and samples here.
        </p>
      )}
    </section>
  );
}

function Session({ name }: { name: string }) {
  const { session, error } = useSession(name);
  if (error) return <Failure error={error} />;
  return session ? <Viewer key={name} session={session} /> : null;
}

export default function Page({ path: [name] }: PageProps) {
  return name === undefined ? (
    <SessionChoice page="matte" title="Look at a matte" />
  ) : (
    <Session name={name} />
  );
}
