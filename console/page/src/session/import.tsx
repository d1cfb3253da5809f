import { useEffect, useRef, useState } from "preact/hooks";
import { Dialog } from "../parts/dialog";
import { FormEnd } from "../parts/form_end";
import { useAction } from "../parts/use_action";
import { bytesText, countText } from "../parts/words";
import { useCameras } from "./cameras";
import {
  archiveIn,
  chosenFiles,
  contents,
  droppedFiles,
  send,
  type Files,
  type LocalArchive,
} from "./import_archive";

/** `dropped`: the files to import; undefined: they are chosen here. */
export function ImportDialog({ dropped, close }: { dropped: Promise<Files> | undefined; close: () => void }) {
  const [archive, setArchive] = useState<LocalArchive>();
  const [name, setName] = useState("");
  const [camera, setCamera] = useState("");
  const [stored, setStored] = useState<number>();
  const { busy, error, act } = useAction();
  const cameras = useCameras() ?? []; // one of them keeps the frames
  const cancel = useRef(new AbortController());
  useEffect(() => () => cancel.current.abort(), []);
  const look = (files: Files | Promise<Files>): void =>
    void act(async () => {
      setArchive(undefined);
      const found = await archiveIn(await contents(await files));
      setArchive(found);
      setName(found.name);
    });
  useEffect(() => dropped && look(dropped), [dropped]);
  const start = async (event: Event): Promise<void> => {
    event.preventDefault();
    if (!archive) return;
    setStored(0);
    const done = await act(() => send(archive, { name, camera }, setStored, cancel.current.signal));
    if (done) location.hash = `#/session/${encodeURIComponent(name)}`;
  };
  const count = archive?.frames.length ?? 0;
  return (
    <Dialog title="Import an archive" close={close}>
      <form class="fields" onSubmit={(event) => void start(event)}>
        {!archive && (
          <>
            <p>
              Choose an archive, or drop it on the list of sessions: its folder, with manifest.json and the
              frames, or the .tar file that “the archive” of a session downloads.
            </p>
            <div class="row">
              <label class="button">
                Choose a .tar file…
                <input
                  type="file"
                  accept=".tar"
                  disabled={busy}
                  onChange={(event) => look(chosenFiles(event.currentTarget.files))}
                />
              </label>
              <label class="button">
                Choose a folder…
                <input
                  type="file"
                  ref={(input) => {
                    if (input) input.webkitdirectory = true;
                  }}
                  disabled={busy}
                  onChange={(event) => look(chosenFiles(event.currentTarget.files))}
                />
              </label>
              {busy && (
                <span class="note" role="status">
                  reading the manifest
                </span>
              )}
            </div>
          </>
        )}
        {archive && (
          <>
            <p>
              {countText(count, "frame")}, {bytesText(archive.bytes)}.
            </p>
            <label>
              Name
              <input
                value={name}
                required
                maxLength={64}
                pattern="[A-Za-z0-9._\-]+"
                title="letters, digits, dots, hyphens and underscores"
                disabled={busy}
                onInput={(event) => setName(event.currentTarget.value)}
              />
            </label>
            {cameras.length > 1 && (
              <label>
                Kept by
                <select
                  value={camera}
                  disabled={busy}
                  required
                  onChange={(event) => setCamera(event.currentTarget.value)}
                >
                  <option value="">choose a camera node</option>
                  {cameras.map((each) => (
                    <option key={each}>{each}</option>
                  ))}
                </select>
              </label>
            )}
            {stored !== undefined && (
              <label>
                <progress max={count} value={stored} />
                <span role="status">
                  {stored} of {countText(count, "frame")}
                </span>
              </label>
            )}
          </>
        )}
        {stored !== undefined && stored > 0 && error !== undefined && (
          <p class="note">
            The frames that arrived are kept: import the archive again under the same name to continue, or delete the session.
          </p>
        )}
        <FormEnd action="Import" busy={busy || !archive} error={error} close={close} />
      </form>
    </Dialog>
  );
}

/** Handlers for an element onto which archives can be dropped. */
export function useDrop(take: (files: Promise<Files>) => void): {
  over: boolean;
  handlers: {
    onDragOver: (event: DragEvent) => void;
    onDragLeave: (event: DragEvent) => void;
    onDrop: (event: DragEvent) => void;
  };
} {
  const [over, setOver] = useState(false);
  const hasFiles = ({ dataTransfer }: DragEvent): boolean => dataTransfer?.types.includes("Files") === true;
  return {
    over,
    handlers: {
      onDragOver: (event) => {
        if (!hasFiles(event)) return;
        event.preventDefault();
        setOver(true);
      },
      onDragLeave: (event) => {
        if (event.target === event.currentTarget) setOver(false);
      },
      onDrop: (event) => {
        setOver(false);
        if (!hasFiles(event)) return;
        event.preventDefault();
        take(droppedFiles(event.dataTransfer!));
      },
    },
  };
}
