import { call, type CallOptions } from "../api";
import type { CaptureManifestJson } from "../gen/glasswing/v1/archive_pb";
import type { GetManifestResponseJson } from "../gen/glasswing/v1/archive_service_pb";
import type { ListNodesResponseJson } from "../gen/glasswing/v1/node_service_pb";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";

/** The manifest of a session's frames, from the node that holds them; an error if that is away. */
export async function manifestOf(
  { name, archiveAddress }: SessionJson,
  options: CallOptions = {},
): Promise<CaptureManifestJson> {
  const { nodes = [] } = await call<ListNodesResponseJson>("NodeService/ListNodes", {}, options);
  const node = nodes.find(({ address }) => address === archiveAddress)?.name;
  if (node === undefined)
    throw new Error(`the node at ${archiveAddress ?? "no address"}, which holds the frames, is away`);
  const { manifest = {} } = await call<GetManifestResponseJson>(
    "ArchiveService/GetManifest",
    { session: name },
    { ...options, node },
  );
  return manifest;
}

const kCapturing = new Set<SessionJson["state"]>(["SESSION_STATE_CREATED", "SESSION_STATE_CAPTURING", "SESSION_STATE_PAUSED"]);

/** Whether the session has frames and gets no more. */
export function isCaptured({ state, archiveAddress }: SessionJson): boolean {
  return Boolean(archiveAddress) && !kCapturing.has(state);
}
