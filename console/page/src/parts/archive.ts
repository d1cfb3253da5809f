import { ApiError, call, type CallOptions } from "../api";
import type { CaptureManifestJson } from "../gen/glasswing/v1/archive_pb";
import type { GetManifestResponseJson } from "../gen/glasswing/v1/archive_service_pb";
import type { ListNodesResponseJson } from "../gen/glasswing/v1/node_service_pb";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";

/** The name of the node that holds a session's frames, which is its camera; an error if that is away. */
export async function nodeOf(
  { archiveAddress }: SessionJson,
  options: CallOptions = {},
): Promise<string> {
  const { nodes = [] } = await call<ListNodesResponseJson>("NodeService/ListNodes", {}, options);
  const node = nodes.find(({ address }) => address === archiveAddress)?.name;
  if (node !== undefined) return node;
  throw new ApiError(
    "UNAVAILABLE",
    `the node at ${archiveAddress ?? "no address"}, which holds the frames, is away`,
  );
}

/** The manifest of a session's frames, from the node that holds them; an error if that is away. */
export async function manifestOf(
  session: SessionJson,
  options: CallOptions = {},
): Promise<CaptureManifestJson> {
  const node = await nodeOf(session, options);
  const { manifest = {} } = await call<GetManifestResponseJson>(
    "ArchiveService/GetManifest",
    { session: session.name },
    { ...options, node },
  );
  return manifest;
}

const kCapturing = new Set<SessionJson["state"]>(["SESSION_STATE_CREATED", "SESSION_STATE_CAPTURING", "SESSION_STATE_PAUSED"]);

/** Whether the session has frames and gets no more. */
export function isCaptured({ state, archiveAddress }: SessionJson): boolean {
  return Boolean(archiveAddress) && !kCapturing.has(state);
}
