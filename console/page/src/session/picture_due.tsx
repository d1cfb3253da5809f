import { call } from "../api";
import type { GetCameraResponseJson, PictureDueJson } from "../gen/glasswing/v1/camera_service_pb";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { nodeOf } from "../parts/archive";
import { useFeed, waited } from "../parts/feed";
import { secondsText } from "../parts/words";
import { isCapturing } from "./states";

const kLookAgain_s = 1;

/** What an on-demand camera waits for, if anything; ends with any other camera. */
async function* duePictures(
  session: SessionJson,
  signal: AbortSignal,
): AsyncGenerator<PictureDueJson | undefined> {
  while (!signal.aborted) {
    const camera = await nodeOf(session, { signal })
      .then((node) => call<GetCameraResponseJson>("CameraService/GetCamera", {}, { node, signal }))
      .catch(() => undefined); // the session says that its camera is away
    if (camera && !camera.onDemand) return;
    yield camera?.due;
    await waited(kLookAgain_s, signal);
  }
}

/** The picture for which a person presses the button, or that a command takes, legible from the camera. */
export function PictureDue({ session }: { session: SessionJson }) {
  const asks = isCapturing(session) && Boolean(session.archiveAddress);
  const { value: due, live } = useFeed<PictureDueJson | undefined>(
    async function* (signal) {
      if (asks) yield* duePictures(session, signal);
    },
    [session.name, session.archiveAddress, asks],
  );
  if (!asks || !live || !due) return null;
  return (
    <section class="card picture-due" aria-labelledby="picture-due">
      <h2 id="picture-due">{due.byHand ? "Press the camera's button" : "The camera takes a picture"}</h2>
      <p class="due digits" role="status">
        {due.what}
      </p>
      <p class="note digits">
        The folder has waited {secondsText(Math.floor(Number(due.waitedNs ?? 0) / 1e9))}.
        {due.byHand && " Press once, and wait for the next number."}
      </p>
      {due.problem && (
        <p class="caution-text" role="status">
          {due.problem}
        </p>
      )}
    </section>
  );
}
