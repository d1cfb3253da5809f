import { matteUrl } from "../light/load";

interface DownloadsProps {
  session: string;
  /** Whether the session's frames are complete. */
  captured: boolean;
  /** "done"; before, "draft" if there is one, or "partial" while tiles are being solved. */
  matte?: "done" | "draft" | "partial" | undefined;
  /** Of a video. */
  frame?: number | undefined;
  /** The matte's. One without monitors gets no link to STMaps. */
  monitors?: readonly string[];
}

/** Links to a session's files. */
export function Downloads({ session, captured, matte, frame, monitors = [] }: DownloadsProps) {
  if (!captured && !matte) return null;
  const name = encodeURIComponent(session);
  const number = frame === undefined ? "" : `-${String(frame).padStart(4, "0")}`;
  return (
    <span class="downloads">
      Download
      {(matte === "partial" || matte === "draft") && (
        <a href={matteUrl(session, { partial: true })} download={`${session}-${matte}.exr`}>
          {matte === "draft" ? "the draft" : "what is solved so far"}
        </a>
      )}
      {matte === "done" && (
        <a href={matteUrl(session, { frame })} download={`${session}${number}.exr`}>
          the matte
        </a>
      )}
      {monitors.map((monitor) => {
        const query = new URLSearchParams({ monitor });
        if (frame !== undefined) query.set("frame", String(frame));
        return (
          <a
            key={monitor}
            href={`/stmaps/${name}.exr?${query}`}
            download={`${session}${number}-stmap-${monitor}.exr`}
            title="Where each pixel looks, for the STMap nodes of compositing programs"
          >
            {monitors.length > 1 ? `the STMap of ${monitor}` : "its STMap"}
          </a>
        );
      })}
      {captured && (
        <a href={`/archives/${name}.tar`} download={`${session}.tar`} title="All frames, and the manifest">
          the archive
        </a>
      )}
    </span>
  );
}
