import { useEffect, useState } from "preact/hooks";
import { loadMatte, matteUrl } from "../light/load";
import type { MatteData } from "../light/matte";
import { Failure } from "../parts/failure";
import { footprintPicture } from "./footprint_picture";
import { Picture, type Place } from "./panel_view";

interface ShapePicturesProps {
  session: string;
  /** Of a video. */
  frame: number | undefined;
  /** Of a row; as `at`, in px of the camera's picture. */
  width: number;
  at: Place;
}

/**
 * Where the light of a pixel of any shape comes from. Its whole row is read again, with pyramids: a narrower region may have no
 * room for them (docs/footprints.md).
 */
export function ShapePictures({ session, frame, width, at: { x, y } }: ShapePicturesProps) {
  const [matte, setMatte] = useState<MatteData>();
  const [error, setError] = useState<unknown>();
  useEffect(() => {
    const cancel = new AbortController();
    setMatte(undefined);
    setError(undefined);
    loadMatte(
      matteUrl(session, { frame, region: { x: 0, y, width, height: 1 } }),
      { signal: cancel.signal, report: () => undefined },
      "footprints",
    ).then(setMatte, (reason: unknown) => cancel.signal.aborted || setError(reason));
    return () => cancel.abort();
  }, [session, frame, width, y]);
  if (error !== undefined) return <Failure error={error} />;
  const drawn = matte?.metadata.monitors.map(({ name }, texture) => ({
    name,
    ...footprintPicture(matte, x, texture),
  }));
  return (
    <>
      {drawn?.map(
        ({ name, box, picture }) =>
          box &&
          picture && (
            <figure key={name} class="footprints">
              <figcaption>
                {name}, its light: {box.width}x{box.height} px from {box.x}, {box.y}
              </figcaption>
              <Picture raster={picture} class="light" />
            </figure>
          ),
      )}
    </>
  );
}
