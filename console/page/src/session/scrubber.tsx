import { useState } from "preact/hooks";
import type { FrameJson } from "../gen/glasswing/v1/archive_pb";
import { LatestPicture } from "../parts/latest_picture";
import { fileName } from "./frames";
import { proofWords, shownWords } from "./stimulus_words";

/** The id as displayed beside the pattern: lowest bit at the left; the upper cell is lit for a 1, the lower one for a 0. */
function PatchId({ id }: { id: number | undefined }) {
  if (id === undefined) return <>none shown</>;
  return (
    <>
      <span class="digits">{id}</span>
      <span class="bits" aria-hidden="true">
        {Array.from({ length: 32 }, (_, cell) => (
          <i key={cell} class={((id >> (cell % 16)) & 1) === (cell < 16 ? 1 : 0) ? "lit" : ""} />
        ))}
      </span>
    </>
  );
}

function Facts({ frame, session }: { frame: FrameJson; session: string }) {
  return (
    <dl class="facts">
      <div>
        <dt>Step</dt>
        <dd>{(frame.step ?? 0) < 0 ? "not of the plan" : (frame.step ?? 0)}</dd>
      </div>
      <div>
        <dt>Shown</dt>
        <dd>{shownWords(frame) || "nothing"}</dd>
      </div>
      <div>
        <dt>Stage</dt>
        <dd>{frame.object ? "with the object" : "empty"}</dd>
      </div>
      <div>
        <dt>Exposure</dt>
        <dd>{Number(frame.exposureMs ?? 0)} ms</dd>
      </div>
      <div>
        <dt>Proof</dt>
        <dd>{proofWords(frame.proof)}</dd>
      </div>
      <div>
        <dt>Id patch</dt>
        <dd>
          <PatchId id={frame.patchId} />
        </dd>
      </div>
      <div>
        <dt>Camera's frame</dt>
        <dd class="digits">{String(frame.sequence ?? "–")}</dd>
      </div>
      <div>
        <dt>File</dt>
        <dd>
          <a href={`/frames/${session}/${fileName(frame)}.tif`} download>
            {frame.file}
          </a>
        </dd>
      </div>
    </dl>
  );
}

interface Props {
  session: string;
  frames: readonly FrameJson[];
  /** Index of the frame shown. */
  at: number;
  choose: (place: number) => void;
  /** True while the newest frame is followed; undefined: no more frames will come. */
  following: boolean | undefined;
  follow: (on: boolean) => void;
}

export function Scrubber({ session, frames, at, choose, following, follow }: Props) {
  const [stops, setStops] = useState(0);
  const frame = frames[at];
  if (!frame) return null;
  return (
    <section class="card scrubber">
      <div class="row">
        <h2>Frames</h2>
        <span class="note">{frames.length.toLocaleString("en")} kept</span>
        {following !== undefined && (
          <label>
            <input
              type="checkbox"
              checked={following}
              onChange={(event) => follow(event.currentTarget.checked)}
            />
            Follow the newest
          </label>
        )}
      </div>
      <label class="frames">
        <span>Frame</span>
        <input
          type="range"
          min={0}
          max={frames.length - 1}
          step={1}
          value={at}
          onInput={(event) => choose(Number(event.currentTarget.value))}
          aria-valuetext={`step ${frame.step ?? 0}: ${shownWords(frame)}`}
        />
        <output class="digits">
          {at + 1} of {frames.length}
        </output>
      </label>
      <div class="scrubber-body">
        <div class="screen">
          <LatestPicture
            src={`/frames/${session}/${fileName(frame)}.jpg?width=1024&stops=${stops}`}
            alt={`Frame of step ${frame.step ?? 0}: ${shownWords(frame)}`}
          />
        </div>
        <div>
          <Facts frame={frame} session={session} />
          <label class="frames">
            Brightness
            <input
              type="range"
              min={-6}
              max={6}
              step={0.5}
              value={stops}
              onInput={(event) => setStops(Number(event.currentTarget.value))}
            />
            <output class="digits">
              {stops > 0 ? "+" : ""}
              {stops.toFixed(1)} stops
            </output>
          </label>
        </div>
      </div>
    </section>
  );
}
