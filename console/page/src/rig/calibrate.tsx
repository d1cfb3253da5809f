import { useEffect, useRef, useState } from "preact/hooks";
import { call, mayOperate, stream } from "../api";
import type {
  CalibrateSyncResponseJson,
  FitCalibrationResponseJson,
  MakePlanResponseJson,
  PlanPurposeJson,
} from "../gen/glasswing/v1/rig_service_pb";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type {
  CreateSessionResponseJson,
  WatchSessionResponseJson,
} from "../gen/glasswing/v1/session_service_pb";
import { Confirm } from "../parts/confirm";
import { Failure } from "../parts/failure";
import { useAction } from "../parts/use_action";

type Kind = "timing" | "camera" | "displays";

const kKinds: Record<Kind, { title: string; before: string; purpose?: PlanPurposeJson; of?: string }> = {
  timing: {
    title: "Measure the monitors' timing",
    before: "The camera must see all monitors. Nothing may stand on the stage.",
  },
  camera: {
    title: "Calibrate the camera",
    before:
      "Measures which light the camera's codes stand for. Take everything off the stage; keep the room dark or its light steady; switch automatic exposure, gain and white balance off, and set the aperture and gain that you will capture with.",
    purpose: "PLAN_PURPOSE_CALIBRATE_CAMERA",
    of: "camera",
  },
  displays: {
    title: "Calibrate the monitors",
    before:
      "Measures which light the monitors make of their codes. Take everything off the stage; let the monitors warm up for half an hour; switch automatic brightness, dynamic contrast and night colours off.",
    purpose: "PLAN_PURPOSE_CALIBRATE_DISPLAYS",
    of: "display",
  },
};

/** Fits the calibration that a captured session measured; returns what could not be measured. */
export async function fitCalibration(session: string): Promise<string[]> {
  const { unmeasured } = await call<FitCalibrationResponseJson>("RigService/FitCalibration", { session });
  return unmeasured ? [...unmeasured] : [];
}

async function measureTiming(tell: (what: string) => void, signal: AbortSignal): Promise<string[]> {
  for await (const { progress } of stream<CalibrateSyncResponseJson>("RigService/CalibrateSync", {}, { signal }))
    if (progress) tell(progress);
  return [];
}

/** Captures a session by the server's plan and fits it. Once captured it can be fitted from its own page, too. */
async function measureLight(kind: Kind, tell: (what: string) => void, signal: AbortSignal): Promise<string[]> {
  const { purpose, of } = kKinds[kind];
  const { plan, notes = [] } = await call<MakePlanResponseJson>("RigService/MakePlan", { purpose }, { signal });
  if (!plan) return [...notes];
  const stamp = new Date().toISOString().replace(/[-:]|\.\d+/g, "");
  const created = await call<CreateSessionResponseJson>(
    "SessionService/CreateSession",
    { requestId: crypto.randomUUID(), name: `calibrate-${of}-${stamp}`, plan },
    { signal },
  );
  const name = created.session?.name ?? "";
  let session: SessionJson = {};
  for await (const { session: now = {} } of stream<WatchSessionResponseJson>(
    "SessionService/WatchSession",
    { name },
    { signal },
  )) {
    session = now;
    tell(`${name}: ${now.provenCount ?? 0} of ${now.stepCount ?? 0} steps`);
  }
  if (session.state !== "SESSION_STATE_CAPTURED")
    throw new Error(`${name} was not captured: ${session.reason || "it was paused or cancelled"}`);
  tell(`${name}: fitting`);
  return [...notes, ...(await fitCalibration(name))];
}

/** Runs calibrations. `done` is called after each. */
export function Calibrate({ done }: { done: () => void }) {
  const [asked, setAsked] = useState<Kind>();
  const [progress, setProgress] = useState("");
  const [notes, setNotes] = useState<string[]>([]);
  const { busy, error, act } = useAction();
  const cancel = useRef<AbortController | undefined>(undefined);
  useEffect(() => () => cancel.current?.abort(), []);
  if (!mayOperate.value) return null;
  const run = async (kind: Kind): Promise<void> => {
    const controller = (cancel.current = new AbortController());
    setProgress("starting");
    setNotes([]);
    await act(async () => {
      const work = kind === "timing" ? measureTiming : measureLight.bind(null, kind);
      setNotes(await work(setProgress, controller.signal));
    });
    done();
  };
  return (
    <>
      <div class="row">
        {(Object.keys(kKinds) as Kind[]).map((kind) => (
          <button key={kind} disabled={busy} onClick={() => setAsked(kind)}>
            {kKinds[kind].title}…
          </button>
        ))}
        {busy && (
          <span class="note" role="status">
            {progress}
          </span>
        )}
      </div>
      {notes.map((note) => (
        <p key={note} class="caution-text">
          {note}
        </p>
      ))}
      {error !== undefined && <Failure error={error} />}
      {asked && (
        <Confirm
          title={kKinds[asked].title}
          action="Start"
          refusal="Cancel"
          run={async () => void run(asked)}
          done={() => undefined}
          close={() => setAsked(undefined)}
        >
          <p>{kKinds[asked].before}</p>
        </Confirm>
      )}
    </>
  );
}
