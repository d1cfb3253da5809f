import { useEffect, useState } from "preact/hooks";
import { ApiError, ask } from "../api";
import type { CaptureManifestJson } from "../gen/glasswing/v1/archive_pb";
import { kChannels, modesOf, samplingOf, type MatteData, type Mode } from "../light/matte";
import { Failure } from "../parts/failure";
import { FootprintMaps } from "./footprint_map";
import { kFlagWords } from "./panels";
import { ShapePictures } from "./shape_pictures";
import { sweepsOf, type Sample, type Sweep } from "./stripes";
import { SweepChart } from "./sweep_chart";

const digits = (value: number, count = 4): string => String(Number(value.toPrecision(count)));
const orUnknown = (error: number): string => (error > 0 ? digits(error, 2) : "unknown");

function flagText(flags: number): string {
  const set = kFlagWords.filter(({ flag }) => flag !== 0 && (flags & flag) !== 0).map(({ words }) => words);
  return set.length > 0 ? set.join(", ") : "good";
}

const kColumns: [string, (mode: Mode, matte: MatteData) => string][] = [
  ["weight", ({ weight }) => digits(weight)],
  ["± weight", ({ weight_sd }) => orUnknown(weight_sd)],
  ["monitor", ({ texture }, { metadata }) => metadata.monitors[texture]?.name ?? ""],
  ["x, px", ({ x }) => x.toFixed(2)],
  ["y, px", ({ y }) => y.toFixed(2)],
  ["± centre", ({ centre_sd }) => orUnknown(centre_sd)],
  ["xx, px²", ({ xx }) => digits(xx)],
  ["xy, px²", ({ xy }) => digits(xy)],
  ["yy, px²", ({ yy }) => digits(yy)],
];

function ModeTable({ matte, pixel }: { matte: MatteData; pixel: number }) {
  const channels = matte.modeChannels === 1 ? ["all"] : kChannels;
  return (
    <div class="wide" tabIndex={0} role="region" aria-label="Modes">
      <table>
        <thead>
          <tr>
            <th scope="col">channel</th>
            {kColumns.map(([title]) => (
              <th key={title} scope="col">
                {title}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {channels.flatMap((name, channel) =>
            modesOf(matte, pixel, channel).map((mode, i) => (
              <tr key={`${name}${i}`}>
                <th scope="row">
                  {name} {i + 1}
                </th>
                {kColumns.map(([title, text]) => (
                  <td key={title}>{text(mode, matte)}</td>
                ))}
              </tr>
            )),
          )}
        </tbody>
      </table>
    </div>
  );
}

function Sweeps({
  matte,
  session,
  x,
  y,
  manifest,
}: {
  matte: MatteData;
  session: string;
  x: number;
  y: number;
  manifest: Promise<CaptureManifestJson>;
}) {
  const [sweeps, setSweeps] = useState<Sweep[]>();
  const [error, setError] = useState<unknown>();
  useEffect(() => {
    const cancel = new AbortController();
    setError(undefined);
    const step = samplingOf(matte.metadata);
    const samples = ask(`/pixels/${encodeURIComponent(session)}?x=${x * step}&y=${y * step}`, {
      signal: cancel.signal,
    }).then((answer) => answer.json() as Promise<{ samples?: Sample[] }>);
    Promise.all([manifest, samples]).then(
      ([known, answer]) => cancel.signal.aborted || setSweeps(sweepsOf(known, answer.samples ?? [])),
      (reason: unknown) => cancel.signal.aborted || setError(reason),
    );
    return () => cancel.abort();
  }, [session, matte, x, y, manifest]);
  if (error)
    return error instanceof ApiError && error.code === "NOT_FOUND" ? (
      <p class="note">The frames no longer exist.</p>
    ) : (
      <Failure error={error} />
    );
  if (!sweeps) return null;
  if (sweeps.length === 0) return <p class="note">This session has no sweeps.</p>;
  return (
    <div class="sweeps">
      {sweeps.map((sweep) => (
        <SweepChart key={sweep.title} matte={matte} pixel={y * matte.width + x} sweep={sweep} />
      ))}
    </div>
  );
}

export interface PixelProps {
  matte: MatteData;
  session: string;
  /** Of a video. */
  frame: number | undefined;
  x: number;
  y: number;
  /** For stills only; a video's frames have no sweeps. */
  manifest: Promise<CaptureManifestJson> | undefined;
}

export function Pixel({ matte, session, frame, x, y, manifest }: PixelProps) {
  const pixel = y * matte.width + x;
  const step = samplingOf(matte.metadata);
  const anyShape = matte.anyShape?.[pixel] === 1;
  const foreground = [0, 1, 2].map((channel) => digits(matte.foreground[3 * pixel + channel]!, 3)).join(", ");
  return (
    <section class="card pixel">
      <h2 aria-live="polite">
        Pixel {x * step}, {y * step}
      </h2>
      <p class="digits">
        F {foreground}; coverage {digits(matte.coverage[pixel]!, 3)}; {flagText(matte.flags[pixel]!)}
      </p>
      {anyShape && (
        <p class="note">
          Its footprint has any shape: the light is drawn as it is; modes are the closest Gaussians.
        </p>
      )}
      <ModeTable matte={matte} pixel={pixel} />
      <div class="maps">
        {anyShape && (
          <ShapePictures
            session={session}
            frame={frame}
            width={(matte.width - 1) * step + 1}
            at={{ x: x * step, y: y * step }}
          />
        )}
        {matte.metadata.monitors.map((monitor, texture) => (
          <FootprintMaps key={monitor.name} matte={matte} pixel={pixel} monitor={monitor} texture={texture} />
        ))}
      </div>
      <h2>Sweeps: samples, and the prediction of the modes</h2>
      {manifest ? (
        <Sweeps matte={matte} session={session} x={x} y={y} manifest={manifest} />
      ) : (
        <p class="note">A video has no sweeps.</p>
      )}
    </section>
  );
}
