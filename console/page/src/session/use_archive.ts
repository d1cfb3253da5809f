import { useEffect, useState } from "preact/hooks";
import { call } from "../api";
import type { CaptureManifestJson } from "../gen/glasswing/v1/archive_pb";
import type { GetManifestResponseJson, GetSpaceResponseJson } from "../gen/glasswing/v1/archive_service_pb";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { nodeOf } from "../parts/archive";
import { waited } from "../parts/feed";
import { isCapturing } from "./states";

export interface ArchiveView {
  manifest?: CaptureManifestJson;
  freeBytes?: number;
}

// A manifest is long: fetching it may take at most this share of the time, and is repeated no more often than kMin_s.
const kShare = 1 / 20,
  kMin_s = 3;

/** The manifest and free space of the node with the session's frames, polled during a capture; empty while it is away. */
export function useArchive(session: SessionJson): ArchiveView {
  const { name = "", archiveAddress } = session;
  const [view, setView] = useState<ArchiveView>({});
  const capturing = isCapturing(session);
  useEffect(() => setView({}), [name]);
  useEffect(() => {
    if (!archiveAddress) return;
    const cancel = new AbortController();
    /** False: the node is away. */
    const look = async (): Promise<boolean> => {
      const node = await nodeOf(session, { signal: cancel.signal });
      const options = { node, signal: cancel.signal };
      const { manifest } = await call<GetManifestResponseJson>(
        "ArchiveService/GetManifest",
        { session: name },
        options,
      );
      const { freeBytes } = await call<GetSpaceResponseJson>("ArchiveService/GetSpace", {}, options);
      setView({ ...(manifest && { manifest }), freeBytes: Number(freeBytes ?? 0) });
      return true;
    };
    const run = async (): Promise<void> => {
      let seen = false;
      do {
        const began = performance.now();
        seen = await look().catch(() => false); // the session's reason reports it
        await waited(Math.max(kMin_s, (performance.now() - began) / 1000 / kShare), cancel.signal);
      } while ((capturing || !seen) && !cancel.signal.aborted);
    };
    void run();
    return () => cancel.abort();
  }, [name, archiveAddress, capturing, capturing ? -1 : session.provenCount]);
  return view;
}
