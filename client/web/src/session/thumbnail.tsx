import { useEffect, useRef, useState } from "preact/hooks";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { manifestOf } from "../parts/archive";
import { fileName, framesBySteps, showpieceOf } from "./frames";
import { isCapturing } from "./states";

const kWidth_px = 160; // of the picture; style.css shows it in half of that

// Each session's frame to show, by its name and number of frames; one manifest is read at a time.
const found = new Map<string, Promise<string | undefined>>();
let reading: Promise<unknown> = Promise.resolve();

function showpiece(session: SessionJson): Promise<string | undefined> {
  const key = `${session.name} ${session.provenCount ?? 0}`;
  let file = found.get(key);
  if (!file) {
    file = reading.then(async () => {
      const frames = framesBySteps(await manifestOf(session));
      const frame = frames[showpieceOf(frames)];
      return frame && fileName(frame);
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
  const [file, setFile] = useState<string>();
  const { name = "", archiveAddress, provenCount = 0 } = session;
  const hasFrames = Boolean(archiveAddress) && provenCount > 0 && !isCapturing(session);
  useEffect(() => {
    if (!hasFrames) return;
    let gone = false;
    const watch = new IntersectionObserver((seen) => {
      if (!seen.some(({ isIntersecting }) => isIntersecting)) return;
      watch.disconnect();
      showpiece(session).then(
        (shown) => gone || setFile(shown),
        () => undefined, // the row says what it can without it
      );
    });
    watch.observe(box.current!);
    return () => ((gone = true), watch.disconnect());
  }, [name, hasFrames, provenCount]);
  return (
    <span ref={box} class="thumbnail">
      {file && <img src={`/frames/${name}/${file}.jpg?width=${kWidth_px}`} alt="" loading="lazy" />}
    </span>
  );
}
