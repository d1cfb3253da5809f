import { useEffect, useRef, useState } from "preact/hooks";
import type { CaptureManifestJson } from "../gen/glasswing/v1/archive_pb";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { manifestOf } from "../parts/archive";
import { fileName, framesBySteps, showpieceOf } from "./frames";
import { isCapturing } from "./states";

const kWidth_px = 160; // of the picture; style.css shows it in half of that

interface Showpiece {
  file: string;
  /** Width over height, without the id patch below a monitor that fills the picture. */
  shape: number;
}

// Each session's frame to show, by its name and number of frames; one manifest is read at a time.
const found = new Map<string, Promise<Showpiece | undefined>>();
let reading: Promise<unknown> = Promise.resolve();

export function shapeAbovePatch({ camera, monitors = [] }: CaptureManifestJson): number {
  const shares = monitors.map(({ heightPx = 1, patchRows = 0 }) => heightPx / (heightPx + patchRows));
  return (camera?.widthPx ?? 1) / ((camera?.heightPx ?? 1) * Math.min(1, ...shares));
}

function showpiece(session: SessionJson): Promise<Showpiece | undefined> {
  const key = `${session.name} ${session.provenCount ?? 0}`;
  let file = found.get(key);
  if (!file) {
    file = reading.then(async () => {
      const manifest = await manifestOf(session);
      const frames = framesBySteps(manifest);
      const frame = frames[showpieceOf(frames)];
      return frame && { file: fileName(frame), shape: shapeAbovePatch(manifest) };
    });
    found.set(key, file);
    file.catch(() => found.delete(key)); // its node may come back
    reading = file.catch(() => undefined);
  }
  return file;
}

/** A session's frame with the object, when the row is first seen; empty during a capture and without frames. */
export function Thumbnail({ session }: { session: SessionJson }) {
  const box = useRef<HTMLSpanElement>(null);
  const [shown, setShown] = useState<Showpiece>();
  const [failure, setFailure] = useState("");
  const { name = "", archiveAddress, provenCount = 0 } = session;
  const hasFrames = Boolean(archiveAddress) && provenCount > 0 && !isCapturing(session);
  useEffect(() => {
    if (!hasFrames) return;
    let gone = false;
    const watch = new IntersectionObserver((seen) => {
      if (!seen.some(({ isIntersecting }) => isIntersecting)) return;
      watch.disconnect();
      showpiece(session).then(
        (piece) => gone || (setShown(piece), setFailure("")),
        (error: unknown) => gone || setFailure(error instanceof Error ? error.message : String(error)),
      );
    });
    watch.observe(box.current!);
    return () => ((gone = true), watch.disconnect());
  }, [name, hasFrames, provenCount]);
  return (
    <span ref={box} class="thumbnail">
      {failure && (
        <span class="note" title={`No picture: ${failure}`}>
          no picture
        </span>
      )}
      {shown && !failure && (
        <img
          src={`/frames/${name}/${shown.file}.jpg?width=${kWidth_px}`}
          alt=""
          loading="lazy"
          onError={() => setFailure("the node that holds the frames did not send it")}
          style={{ "--shape": shown.shape }}
        />
      )}
    </span>
  );
}
