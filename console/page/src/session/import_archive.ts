// Sends an archive from this machine to the server: as a folder of frames with manifest.json, or as a tar file of it. Frames
// are read from the disk while they are sent.
import { ask, call } from "../api";
import type { BeginImportResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { filesOfTar } from "./tar";

const kMaxFiles = 100_000;
const kMaxManifest = 64 * 2 ** 20; // bytes
const kMaxFrame = 2 ** 30 - 2 ** 17; // bytes, so that it fits into a request
const kBatchBytes = 32 * 2 ** 20;
const kBatchFrames = 1000;

interface ArchiveFrame {
  /** The frame of the manifest, with the file's size. */
  record: object;
  file: Blob;
}

/** An archive of which every file is there. */
export interface LocalArchive {
  /** For the new session: the one that the archive was captured as. */
  name: string;
  manifest: string;
  frames: ArchiveFrame[];
  bytes: number;
}

/** Files by their paths. */
export type Files = Map<string, Blob>;

/** The files that were chosen or dropped: those of a folder, or the contents of a single tar file. */
export async function contents(files: Files): Promise<Files> {
  const [only] = files;
  if (files.size !== 1 || !only?.[0].endsWith(".tar")) return files;
  return filesOfTar(only[1], kMaxFiles).catch((error: Error) => {
    throw new Error(`${only[0]} cannot be imported: ${error.message}`);
  });
}

async function filesBelow(entry: FileSystemEntry, files: Files): Promise<void> {
  if (files.size > kMaxFiles) throw new Error(`the folder has more than ${kMaxFiles} files`);
  const path = entry.fullPath.replace(/^\//, "");
  if (entry.isFile) {
    const file = await new Promise<File>((resolve, reject) =>
      (entry as FileSystemFileEntry).file(resolve, reject),
    );
    files.set(path, file);
    return;
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  for (;;) {
    // At most 100 at a time.
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) =>
      reader.readEntries(resolve, reject),
    );
    if (some.length === 0) return;
    for (const each of some) await filesBelow(each, files);
  }
}

/** Of a drop; to be called during its event. */
export async function droppedFiles({ items }: DataTransfer): Promise<Files> {
  const dropped = [...items].map((item) => ({ entry: item.webkitGetAsEntry(), file: item.getAsFile() }));
  const files: Files = new Map();
  for (const { entry, file } of dropped) {
    if (entry) await filesBelow(entry, files);
    else if (file) files.set(file.name, file);
  }
  return files;
}

export function chosenFiles(list: FileList | null): Files {
  return new Map([...(list ?? [])].map((file) => [file.webkitRelativePath || file.name, file]));
}

interface ManifestJson {
  session?: string;
  frames?: ({ file?: string; size_bytes?: string | number } | null)[];
}

function parsed(manifest: string, path: string): ManifestJson {
  try {
    const json: unknown = JSON.parse(manifest);
    if (typeof json === "object" && json !== null) return json;
  } catch {
    // the same error
  }
  throw new Error(`${path} is not a JSON object: it is damaged, or not the manifest of an archive`);
}

/** Finds the archive among the files. An error names what is missing, or is not what the manifest says. */
export async function archiveIn(files: Files): Promise<LocalArchive> {
  const manifests = [...files.keys()].filter((path) => /(^|\/)manifest\.json$/.test(path));
  if (manifests.length !== 1) {
    throw new Error(
      manifests.length === 0
        ? "there is no manifest.json: it must be the folder of an archive, or the .tar file that a session's page downloads"
        : `there are ${manifests.length} archives (${manifests.slice(0, 3).join(", ")}): drop one at a time`,
    );
  }
  const path = manifests[0]!;
  const folder = path.slice(0, -"manifest.json".length);
  const { size } = files.get(path)!;
  if (size > kMaxManifest) throw new Error(`${path} has ${size} bytes; at most ${kMaxManifest} are taken`);
  const manifest = await files.get(path)!.text();
  const { session = "", frames: listed } = parsed(manifest, path);
  if (!Array.isArray(listed) || listed.length === 0) throw new Error(`${path} lists no frames`);
  if (listed.length > kMaxFiles)
    throw new Error(`${path} lists ${listed.length} frames; at most ${kMaxFiles} are taken`);
  const frames = listed.map((frame) => {
    const name = frame?.file ?? "";
    const file = files.get(folder + name);
    if (!file) throw new Error(`the frame ${folder}${name} is missing; ${path} lists it`);
    const expected = Number(frame?.size_bytes ?? file.size);
    if (file.size !== expected)
      throw new Error(`${folder}${name} has ${file.size} bytes; ${path} lists it with ${expected}`);
    if (file.size > kMaxFrame)
      throw new Error(`${folder}${name} has ${file.size} bytes; at most ${kMaxFrame} are taken`);
    return { record: { ...frame, size_bytes: String(file.size) }, file };
  });
  return { name: session, manifest, frames, bytes: frames.reduce((sum, { file }) => sum + file.size, 0) };
}

/** Cuts frames into requests of about 32 MiB: fewer would be stored more often, more would lose more progress. */
export function batches(frames: readonly ArchiveFrame[]): ArchiveFrame[][] {
  const cut: ArchiveFrame[][] = [];
  let bytes = Infinity;
  for (const frame of frames) {
    const last = cut.at(-1);
    if (!last || last.length === kBatchFrames || bytes + frame.file.size > kBatchBytes) {
      cut.push([frame]);
      bytes = frame.file.size;
    } else {
      last.push(frame);
      bytes += frame.file.size;
    }
  }
  return cut;
}

/**
 * Sends the archive as a new session. `tell` gets the number of frames that are stored. What arrived before an error stays;
 * under the same name the import goes on.
 */
export async function send(
  { manifest, frames }: LocalArchive,
  { name, camera }: { name: string; camera: string },
  tell: (stored: number) => void,
  signal: AbortSignal,
): Promise<void> {
  const path = `/imports/${encodeURIComponent(name)}`;
  const begun = await ask(`${path}?camera=${encodeURIComponent(camera)}`, {
    method: "POST",
    body: manifest,
    signal,
  });
  const { importToken = "" } = (await begun.json()) as BeginImportResponseJson;
  let stored = 0;
  for (const batch of batches(frames)) {
    const body = new Blob(batch.flatMap(({ record, file }) => [`${JSON.stringify(record)}\n`, file]));
    await ask(`${path}/frames`, { method: "POST", headers: { "X-Glasswing-Import": importToken }, body, signal });
    tell((stored += batch.length));
  }
  await call("SessionService/FinishImport", { name }, { signal });
}
