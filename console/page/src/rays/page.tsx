// Rays of two sessions before monitors at two depths: made by the console, played in an environment, and seen in space.
import { useEffect, useRef, useState } from "preact/hooks";
import { call } from "../api";
import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { ListSessionsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { samplingOf } from "../light/matte";
import type { PageProps } from "../pages";
import { Failure } from "../parts/failure";
import { save } from "../parts/save";
import { framesOf } from "../parts/use_session";
import { Surrounded } from "../play/surrounded";
import { Counts } from "./counts";
import { figuresOf, type Rig } from "./geometry";
import { makeRays, rayFile, readGeometry, type Depth, type MadeRays, type RayChoice } from "./made_rays";
import { RigTable } from "./rig_table";
import { RigView } from "./rig_view";
import "./rays.css";

const kMaxGeometry = 1 << 20; // bytes, as the console takes

interface Geometry {
  name: string;
  text: string;
  rig: Rig;
}

const kKept = "geometry";
/** Survives a reload of the page, in this tab. */
function keep(name: string, text: string): void {
  try {
    sessionStorage.setItem(kKept, JSON.stringify({ name, text }));
  } catch {
    // It is larger than browsers keep.
  }
}
function kept(): { name: string; text: string } | undefined {
  return JSON.parse(sessionStorage.getItem(kKept) ?? "null") ?? undefined;
}

/** Names of poses, in the geometry's order. */
const posesOf = (rig: Rig | undefined): string[] => [...new Set((rig?.poses ?? []).map(({ name }) => name))];

/** Rays are of stills. */
function hasRays(session: SessionJson): boolean {
  return session.matteReady === true && framesOf(session).length === 0;
}

interface DepthFieldProps {
  label: string;
  sessions: SessionJson[];
  poses: string[];
  depth: Depth;
  change: (depth: Depth) => void;
}

function DepthField({ label, sessions, poses, depth, change }: DepthFieldProps) {
  const isOwn = poses.includes(depth.session);
  const choose = (session: string): void => change({ session, pose: poses.includes(session) ? session : "" });
  return (
    <div class="depth">
      <label>
        {label}
        <select value={depth.session} onChange={(event) => choose(event.currentTarget.value)}>
          <option value="">choose a session</option>
          {sessions.map(({ name }) => (
            <option key={name} value={name}>
              {name}
            </option>
          ))}
        </select>
      </label>
      {depth.session !== "" && poses.length > 0 && (
        <label>
          Pose
          <select value={depth.pose} onChange={(event) => change({ ...depth, pose: event.currentTarget.value })}>
            {!isOwn && <option value="">choose its pose</option>}
            {poses.map((name) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </label>
      )}
      {depth.session !== "" && poses.length > 0 && depth.pose === "" && (
        <p class="note caution-text">
          The geometry has no pose “{depth.session}”; choose where the monitor stood in this session.
        </p>
      )}
    </div>
  );
}

function Made({ made, choice, rig }: { made: MadeRays; choice: RayChoice; rig: Rig }) {
  const [error, setError] = useState<unknown>();
  const [saving, setSaving] = useState(false);
  const name = `${choice.depths[0].session}-${choice.depths[1].session}`;
  const sampling = samplingOf(made.description.metadata);
  const download = (): void => {
    setSaving(true);
    rayFile(choice)
      .then((file) => (setError(undefined), save(file, `${name}-rays.exr`)), setError)
      .finally(() => setSaving(false));
  };
  return (
    <>
      <Surrounded name={name} rays={made.drawable} view_deg={made.description.view_deg ?? 60} />
      <section class="card">
        <div class="row">
          <h2>Rays</h2>
          {sampling === 1 && (
            <button class="inline" onClick={download} disabled={saving}>
              {saving ? "Making the file…" : "Download rays.exr"}
            </button>
          )}
        </div>
        {error !== undefined && <Failure error={error} />}
        <Counts counts={made.counts} />
        {sampling > 1 && (
          <p class="note">
            Of {sampling} × {sampling} pixels one is in these rays; <code>glasswing rays</code> makes those of all.
          </p>
        )}
      </section>
      <RigSection rig={rig} chosen={made.poses} made={made} />
    </>
  );
}

function RigSection({ rig, chosen, made }: { rig: Rig; chosen: string[]; made?: MadeRays }) {
  return (
    <section class="card rig-space">
      <h2>The rig in space</h2>
      <RigView rig={rig} chosen={chosen} rays={made?.sampled} />
      <RigTable rig={rig} />
    </section>
  );
}

const kNobody: Depth = { session: "", pose: "" };

export default function Page({ path: [near = "", far = ""] }: PageProps) {
  const [sessions, setSessions] = useState<SessionJson[]>();
  const [depths, setDepths] = useState<[Depth, Depth]>([{ ...kNobody, session: near }, { ...kNobody, session: far }]);
  const [geometry, setGeometry] = useState<Geometry>();
  const [lossless, setLossless] = useState(false);
  const [made, setMade] = useState<{ rays: MadeRays; choice: RayChoice; rig: Rig; id: number }>();
  const [making, setMaking] = useState(false);
  const [over, setOver] = useState(false);
  const [error, setError] = useState<unknown>();
  const cancel = useRef<AbortController | undefined>(undefined);

  const openText = async (name: string, text: string, all: SessionJson[] = sessions ?? []): Promise<void> => {
    const rig = await readGeometry(text);
    keep(name, text);
    setError(undefined);
    setMade(undefined);
    setGeometry({ name, text, rig });
    const poses = posesOf(rig);
    setDepths((before) => {
      const known = before.map((depth) => ({ ...depth, pose: poses.includes(depth.session) ? depth.session : "" }));
      const named = poses.filter((pose) => all.some((session) => session.name === pose));
      // Two sessions are named as poses: they are those that are meant.
      if (known.some(({ session }) => session !== "") || named.length !== 2) return known as [Depth, Depth];
      const away = (pose: string): number => figuresOf(rig.poses.find((each) => each.name === pose)!).distance.value;
      named.sort((a, b) => away(a) - away(b));
      return named.map((name) => ({ session: name, pose: name })) as [Depth, Depth];
    });
  };
  const open = async (file: File): Promise<void> => {
    try {
      if (file.size > kMaxGeometry)
        throw new Error(`${file.name} has ${file.size} bytes; a geometry's text has at most ${kMaxGeometry}`);
      await openText(file.name, await file.text());
    } catch (reason) {
      setError(reason);
    }
  };
  useEffect(() => {
    const begin = async (): Promise<void> => {
      const { sessions: all = [] } = await call<ListSessionsResponseJson>("SessionService/ListSessions");
      const able = all.filter(hasRays);
      setSessions(able);
      const before = kept();
      if (before) await openText(before.name, before.text, able);
    };
    begin().catch(setError);
    return () => cancel.current?.abort();
  }, []);

  const change = (which: number, depth: Depth): void =>
    setDepths((before) => before.map((each, i) => (i === which ? depth : each)) as [Depth, Depth]);
  const isReady = geometry !== undefined && depths.every(({ session, pose }) => session !== "" && pose !== "");
  const make = async (isLossless: boolean): Promise<void> => {
    if (!geometry) return;
    cancel.current?.abort();
    const mine = (cancel.current = new AbortController());
    const choice: RayChoice = { depths, geometry: geometry.text, lossless: isLossless };
    setMaking(true);
    setError(undefined);
    try {
      const rays = await makeRays(choice, mine.signal);
      if (mine.signal.aborted) return;
      setMade((before) => ({ rays, choice, rig: geometry.rig, id: (before?.id ?? 0) + 1 }));
      const [one, other] = depths.map(({ session }) => encodeURIComponent(session));
      history.replaceState(null, "", `#/rays/${one}/${other}`);
    } catch (reason) {
      if (!mine.signal.aborted) setError(reason);
    }
    if (cancel.current === mine) setMaking(false);
  };

  if (!sessions) return error !== undefined ? <Failure error={error} /> : null;
  const poses = posesOf(geometry?.rig);
  return (
    <div
      class={`rays-page${over ? " over" : ""}`}
      onDragOver={(event) => (event.preventDefault(), setOver(true))}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        setOver(false);
        const file = event.dataTransfer?.files[0];
        if (file) void open(file);
      }}
    >
      <section class="card">
        <h1>Rays</h1>
        <p class="note">
          Two sessions of one object in front of monitors at two depths show along which lines its light came. With them it
          stands in any environment. The geometry is the file that <code>glasswing calibrate geometry</code> writes: drop
          it here, or choose it.
        </p>
        <div class="ray-choice">
          <label class="button">
            {geometry ? `Geometry: ${geometry.name}` : "Choose a geometry…"}
            <input
              type="file"
              accept=".txtpb,.textproto,.txt,text/plain"
              aria-label="Geometry"
              onChange={(event) => {
                const chosen = event.currentTarget.files?.[0];
                if (chosen) void open(chosen);
                event.currentTarget.value = "";
              }}
            />
          </label>
          <DepthField label="Near" sessions={sessions} poses={poses} depth={depths[0]} change={(to) => change(0, to)} />
          <DepthField label="Far" sessions={sessions} poses={poses} depth={depths[1]} change={(to) => change(1, to)} />
          <label title="Light that no monitor showed is the environment's mean. For clear glass; a guess for everything else.">
            <input
              type="checkbox"
              checked={lossless}
              onChange={(event) => {
                setLossless(event.currentTarget.checked);
                if (made && isReady) void make(event.currentTarget.checked);
              }}
            />
            Absorbs nothing
          </label>
          <button class="primary" disabled={!isReady || making} onClick={() => void make(lossless)}>
            {making ? "Making rays…" : "Make rays"}
          </button>
        </div>
        {sessions.length < 2 && (
          <p class="note">There must be two sessions with mattes; {sessions.length === 0 ? "none has one" : "one has one"} yet.</p>
        )}
        {making && <progress aria-label="Making rays" />}
        {error !== undefined && <Failure error={error} />}
      </section>
      {made ? (
        <Made key={made.id} made={made.rays} choice={made.choice} rig={made.rig} />
      ) : (
        geometry && <RigSection rig={geometry.rig} chosen={depths.map(({ pose }) => pose).filter((pose) => pose !== "")} />
      )}
    </div>
  );
}
