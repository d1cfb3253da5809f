import { useEffect, useRef, useState } from "preact/hooks";
import { call, mayOperate } from "../api";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";
import type {
  CreateSessionResponseJson,
  EstimateSessionResponseJson,
} from "../gen/glasswing/v1/session_service_pb";
import { Failure } from "../parts/failure";
import { Message } from "../parts/message";
import { useAction } from "../parts/use_action";
import { bytesText, countText, secondsText, timeText } from "../parts/words";
import { namedCameras, useCameras } from "./cameras";
import { MadePlan } from "./made_plan";
import { missingPhotos, withPhotos } from "./photos";
import { fitText, kPlanNames, planText, useFits } from "./ready_plans";
import { usePlan } from "./use_plan";

function Estimate({ estimate }: { estimate: EstimateSessionResponseJson }) {
  const {
    stepCount = 0,
    stepsWithoutObject = 0,
    seconds,
    bytes,
    freeBytes,
    monitors = [],
    cameras = [],
    holder,
    warnings = [],
  } = estimate;
  return (
    <>
      <dl class="figures">
        <div>
          <dt>Steps</dt>
          <dd>
            {stepCount.toLocaleString("en")}
            <span class="note"> {stepsWithoutObject} without the object</span>
          </dd>
        </div>
        <div>
          <dt>Takes</dt>
          <dd>
            {secondsText(Number(seconds ?? 0))}
            <span class="note"> without repeated steps</span>
          </dd>
        </div>
        <div>
          <dt>Frames</dt>
          <dd>
            {bytesText(Number(bytes ?? 0))}
            <span class="note"> of {bytesText(Number(freeBytes ?? 0))} free</span>
          </dd>
        </div>
        <div>
          <dt>Monitors</dt>
          <dd>
            {monitors
              .map(
                ({ name, widthPx, heightPx, refreshHz }) =>
                  `${name} ${widthPx}×${heightPx}, ${Number(refreshHz ?? 0).toFixed(0)} Hz`,
              )
              .join("; ")}
          </dd>
        </div>
        {cameras.length > 1 && (
          <div>
            <dt>Cameras</dt>
            <dd>{cameras.map(({ name, widthPx, heightPx }) => `${name} ${widthPx}×${heightPx}`).join("; ")}</dd>
          </div>
        )}
        {estimate.videoFrames && (
          <div>
            <dt>Video</dt>
            <dd>
              {countText(estimate.videoFrames, "frame")}
              <span class="note"> in {secondsText(Number(estimate.videoSeconds ?? 0))}</span>
            </dd>
          </div>
        )}
      </dl>
      {holder && (
        <p class="caution-text">
          The rig is in use{holder.client && ` by ${holder.client}`} since {timeText(holder.since ?? "")}:{" "}
          {holder.what}
          .
        </p>
      )}
      {warnings.map((warning) => (
        <p key={warning} class="caution-text">
          <Message text={warning} />
        </p>
      ))}
    </>
  );
}

interface CamerasProps {
  up: readonly string[];
  used: readonly string[];
  onChange: (used: ReadonlySet<string>) => void;
}

/** Which cameras see each step; the last one stays. */
function Cameras({ up, used, onChange }: CamerasProps) {
  const take = (name: string, takes: boolean): void => {
    const rest = used.filter((each) => each !== name);
    if (takes || rest.length > 0) onChange(new Set(takes ? [...rest, name] : rest));
  };
  return (
    <fieldset class="row">
      <legend>Cameras</legend>
      {up.map((name) => (
        <label key={name}>
          <input
            type="checkbox"
            checked={used.includes(name)}
            disabled={used.length === 1 && used.includes(name)}
            onChange={(event) => take(name, event.currentTarget.checked)}
          />
          {name}
        </label>
      ))}
    </fieldset>
  );
}

const kMade = "+made", kOwn = "+own"; // no plan's name has a plus

export function NewSession() {
  const [chosen, setChosen] = useState(kMade); // or the name of a ready plan
  const [text, setText] = useState("");
  const [name, setName] = useState("");
  const [note, setNote] = useState("");
  const [tags, setTags] = useState("");
  const [solve, setSolve] = useState(true);
  const [adapts, setAdapts] = useState(false);
  const [anyShape, setAnyShape] = useState(false); // footprints of what adapts
  const [photos, setPhotos] = useState<File[]>([]);
  const requestId = useRef(crypto.randomUUID()); // the same for every attempt, so that a lost answer creates no second session
  const up = useCameras();
  const [cameras, setCameras] = useState<ReadonlySet<string>>(); // undefined: the plan's, or all
  const { plan, estimate, error } = usePlan(text, name, up, cameras);
  const [named, setNamed] = useState<readonly string[]>([]); // by the last plan
  const start = useAction();
  const fits = useFits(up);
  useEffect(() => {
    if (plan) setNamed(namedCameras(plan));
  }, [plan]);
  useEffect(() => {
    if (kPlanNames.includes(chosen)) void planText(chosen).then(setText);
  }, [chosen]);
  if (!mayOperate.value) return <p>Only operators can start sessions; you are logged in as a viewer.</p>;

  const mayAdapt = plan?.method === "gaussian";
  const asked = (whole: PlanJson): PlanJson =>
    adapts && mayAdapt ? { ...whole, adapt: { ...whole.adapt, ...(anyShape && { footprints: "any" }) } } : whole;
  const missing = plan ? missingPhotos(plan, photos) : [];
  const open = async (file: File | undefined): Promise<void> => {
    if (!file) return;
    setChosen(kOwn);
    setText(await file.text());
  };
  const create = async (event: Event): Promise<void> => {
    event.preventDefault();
    await start.act(async () => {
      const full = await withPhotos(plan!, photos, estimate?.monitors ?? []);
      const { session } = await call<CreateSessionResponseJson>("SessionService/CreateSession", {
        requestId: requestId.current,
        name,
        plan: asked(full),
        solve: solve && !plan?.calibration,
      });
      const addTags = tags.split(/\s+/).filter(Boolean);
      if (note || addTags.length > 0)
        await call("SessionService/AnnotateSession", { name: session?.name, note, addTags });
      location.hash = `#/session/${encodeURIComponent(session?.name ?? "")}`;
    });
  };
  const enqueue = async (): Promise<void> => {
    await start.act(async () => {
      const addTags = tags.split(/\s+/).filter(Boolean);
      const wish = { session: name, plan: asked(plan!), solve: solve && !plan?.calibration, note, tags: addTags, retries: 3, retryWaitS: 60 };
      await call("QueueService/AddQueueItem", { requestId: requestId.current, wish });
      location.hash = "#/queue";
    });
  };
  return (
    <form class="session" onSubmit={(event) => void create(event)}>
      <div class="row">
        <h1>New session</h1>
        <span class="spacer" />
        <a href="#/session">All sessions</a>
      </div>
      <section class="card fields">
        <div class="row">
          <label>
            Plan
            <select value={chosen} onChange={(event) => setChosen(event.currentTarget.value)}>
              <option value={kMade}>made for this rig</option>
              {chosen === kOwn && <option value={kOwn}>your own</option>}
              {kPlanNames.map((each) => (
                <option key={each} value={each}>
                  {fitText(fits, each)}
                </option>
              ))}
            </select>
          </label>
          <label class="button">
            Open a file…
            <input
              type="file"
              accept=".txtpb,text/plain"
              onChange={(event) => void open(event.currentTarget.files?.[0])}
            />
          </label>
          <label>
            Name
            <input
              type="text"
              pattern="[A-Za-z0-9._\-]{1,64}"
              title="Letters, digits, dots, dashes and underscores"
              placeholder="chosen by the server"
              value={name}
              onInput={(event) => setName(event.currentTarget.value)}
            />
          </label>
        </div>
        {chosen === kMade && up && (
          <MadePlan camera={up.length > 1 ? (up.find((each) => !cameras || cameras.has(each)) ?? "") : ""} onText={setText} />
        )}
        {up && up.length > 1 && named.length > 0 && (
          <Cameras up={up} used={cameras ? up.filter((each) => cameras.has(each)) : named} onChange={setCameras} />
        )}
        <div class="row">
          <label class="grows">
            Note
            <input
              type="text"
              maxLength={1000}
              value={note}
              onInput={(event) => setNote(event.currentTarget.value)}
            />
          </label>
          <label class="grows">
            Tags
            <input
              type="text"
              pattern="\s*([A-Za-z0-9._\-]{1,64}(\s+|$))*"
              title="Words of letters, digits, dots, dashes and underscores, separated by spaces"
              placeholder="separated by spaces"
              value={tags}
              onInput={(event) => setTags(event.currentTarget.value)}
            />
          </label>
        </div>
        <details>
          <summary>Edit the plan's text</summary>
          <textarea
            class="plan"
            aria-label="The plan's text"
            spellcheck={false}
            rows={18}
            value={text}
            onInput={(event) => {
              setChosen(kOwn);
              setText(event.currentTarget.value);
            }}
          />
        </details>
        {plan?.photos && plan.photos.length > 0 && (
          <div class="row">
            <label class="button">
              Choose its pictures…
              <input
                type="file"
                accept="image/*"
                multiple
                onChange={(event) => setPhotos([...photos, ...(event.currentTarget.files ?? [])])}
              />
            </label>
            <span class={missing.length > 0 ? "caution-text" : "note"}>
              {missing.length > 0
                ? `Missing: ${missing.join(", ")}`
                : "All pictures are chosen."}
            </span>
          </div>
        )}
      </section>
      <section class="card" aria-live="polite">
        <h2>Estimate</h2>
        {error !== undefined && <Failure error={error} />}
        {estimate ? (
          <Estimate estimate={estimate} />
        ) : (
          error === undefined && <p class="note">Checking the rig…</p>
        )}
        {start.error !== undefined && <Failure error={start.error} />}
        <div class="row">
          {!plan?.calibration && (
            <label>
              <input type="checkbox" checked={solve} onChange={(event) => setSolve(event.currentTarget.checked)} />
              Solve it as soon as it is captured
            </label>
          )}
          {mayAdapt && (
            <label>
              <input type="checkbox" checked={adapts} onChange={(event) => setAdapts(event.currentTarget.checked)} />
              Show further images until the object is known
            </label>
          )}
          {mayAdapt && adapts && (
            <label title="Drafts and matte with footprints=any: pixels that no few Gaussians explain ask for waves in more directions">
              <input type="checkbox" checked={anyShape} onChange={(event) => setAnyShape(event.currentTarget.checked)} />
              Also of footprints of any shape
            </label>
          )}
          <button class="primary" disabled={start.busy || !estimate || missing.length > 0}>
            {start.busy ? "Starting…" : "Start"}
          </button>
          <button
            type="button"
            title={plan?.photos?.length ? "Plans with photos cannot be queued" : undefined}
            disabled={start.busy || !plan || (plan.photos?.length ?? 0) > 0}
            onClick={() => void enqueue()}
          >
            Add to the queue
          </button>
        </div>
      </section>
    </form>
  );
}
