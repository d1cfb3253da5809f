// The rig in space: the camera, monitors at their poses, and some of the rays.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { colourOf, useDark } from "../parts/colours";
import { listenToMoves } from "../parts/pointers";
import { kRayStates, type RayState, type Rig, type SampledRay } from "./geometry";
import { byKey, orbitAround, turnedBy, View, zoomedBy, type Orbit, type Point } from "./orbit";
import { fromCamera, frustumOf, gapOf, linesOfPose, linesOfRays, placesOf, type Line } from "./rig_lines";

const kTokens: Record<RayState, string> = {
  matched: "--ray-matched",
  ambiguous: "--ray-ambiguous",
  extrapolated: "--ray-extrapolated",
  unknown: "--ray-unknown",
};
const kTurn_deg = 0.4; // a px
const kSides: [string, number, number][] = [
  ["From the side", 62, 18],
  ["From above", 0, 89],
];

/** Turns by one pointer, scales by two and the wheel, or does both by keys. Returns a function that removes the listeners. */
function listen(canvas: HTMLCanvasElement, get: () => Orbit, set: (orbit: Orbit) => void, first: () => Orbit): () => void {
  return listenToMoves(canvas, {
    move: (dx, dy, factor) => set(zoomedBy(turnedBy(get(), -kTurn_deg * dx, kTurn_deg * dy), factor, first())),
    scale: (factor) => set(zoomedBy(get(), factor, first())),
    key: (event) => {
      const orbit = byKey(event, get(), first());
      if (orbit) set(orbit);
      return orbit !== undefined;
    },
  });
}

interface Label {
  x: number;
  end: number;
  y: number;
}
const kLine_px = 18;

interface Drawn {
  frustum: Line[];
  poses: (ReturnType<typeof linesOfPose> & { isChosen: boolean })[];
  rays: Record<RayState, Line[]> | undefined;
}

function draw(canvas: HTMLCanvasElement, orbit: Orbit, { frustum, poses, rays }: Drawn, hidden: ReadonlySet<RayState>): void {
  const scale = devicePixelRatio;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
  const pen = canvas.getContext("2d")!;
  pen.scale(scale, scale);
  pen.fillStyle = colourOf("--card");
  pen.fillRect(0, 0, width, height);
  const view = new View(orbit, width, height);
  const stroke = (lines: Line[], token: string, thickness: number, strength = 1): void => {
    pen.strokeStyle = colourOf(token);
    pen.lineWidth = thickness;
    pen.globalAlpha = strength;
    pen.beginPath();
    for (const [from, to] of lines) {
      const seen = view.line(from, to);
      if (!seen) continue;
      pen.moveTo(...seen[0]);
      pen.lineTo(...seen[1]);
    }
    pen.stroke();
    pen.globalAlpha = 1;
  };
  for (const { grid, isChosen } of poses) if (isChosen) stroke(grid, "--faint", 0.75, 0.45);
  if (rays) {
    // Few lines are strong, many are thin.
    const count = kRayStates.reduce((sum, state) => sum + (hidden.has(state) ? 0 : rays[state].length), 0);
    // Of the surest least is hidden.
    for (const state of kRayStates.toReversed()) if (!hidden.has(state)) stroke(rays[state], kTokens[state], 1, count > 400 ? 0.4 : 0.7);
  }
  for (const { edges, isChosen } of poses) stroke(edges, isChosen ? "--ink" : "--faint", isChosen ? 1.75 : 1, isChosen ? 1 : 0.5);
  stroke(frustum, "--accent", 1.75);
  pen.font = `13px ${getComputedStyle(canvas).fontFamily}`;
  pen.textBaseline = "bottom";
  const labels: Label[] = [];
  const label = (text: string, at: Point | undefined, token: string): void => {
    if (!at) return;
    const wide = pen.measureText(text).width;
    const x = Math.min(Math.max(4, at[0]), Math.max(4, width - wide - 6));
    let y = Math.min(Math.max(20, at[1] - 3), height - 4);
    const covers = (other: Label): boolean => x < other.end && x + wide > other.x && Math.abs(y - other.y) < kLine_px;
    while (y > 2 * kLine_px && labels.some(covers)) y -= kLine_px;
    labels.push({ x, y, end: x + wide });
    pen.globalAlpha = 0.8;
    pen.fillStyle = colourOf("--card");
    pen.fillRect(x - 3, y - 16, wide + 6, 18);
    pen.globalAlpha = 1;
    pen.fillStyle = colourOf(token);
    pen.fillText(text, x, y);
  };
  for (const { label: text, corner, isChosen } of poses) if (isChosen) label(text, view.point(corner), "--ink");
  label("camera", view.point([0, 0, 0]), "--accent");
}

interface RigViewProps {
  rig: Rig;
  /** Names of the poses that the rays are made of. */
  chosen: string[];
  rays: SampledRay[] | undefined;
}

export function RigView({ rig, chosen, rays }: RigViewProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const first = useMemo(() => orbitAround(placesOf(rig), kSides[0]![1], kSides[0]![2]), [rig]);
  const [orbit, setOrbit] = useState(first);
  const [hidden, setHidden] = useState<ReadonlySet<RayState>>(new Set());
  const [width, setWidth] = useState(0);
  const isDark = useDark();
  const now = useRef(orbit);
  now.current = orbit;
  const start = useRef(first);
  start.current = first;

  useEffect(() => setOrbit(first), [first]);
  useEffect(() => {
    const observer = new ResizeObserver(() => setWidth(canvas.current?.clientWidth ?? 0));
    observer.observe(canvas.current!);
    const end = listen(
      canvas.current!,
      () => now.current,
      (to) => setOrbit((now.current = to)),
      () => start.current,
    );
    return () => (observer.disconnect(), end());
  }, []);
  const drawn = useMemo((): Drawn => {
    const [near, far] = chosen.map((name) => rig.poses.find((pose) => pose.name === name));
    return {
      frustum: frustumOf(rig),
      poses: rig.poses.map((pose) => ({ ...linesOfPose(pose), isChosen: chosen.includes(pose.name) || chosen.length === 0 })),
      rays: rays && near && far ? linesOfRays(rays, gapOf(near, far)) : undefined,
    };
  }, [rig, rays, chosen.join("\n")]);
  useEffect(() => draw(canvas.current!, orbit, drawn, hidden), [orbit, drawn, hidden, isDark, width]);

  const toggle = (state: RayState): void =>
    setHidden((before) => {
      const after = new Set(before);
      if (!after.delete(state)) after.add(state);
      return after;
    });
  return (
    <figure class="rig-view">
      <canvas
        ref={canvas}
        tabIndex={0}
        role="application"
        aria-label={`The rig in space: the camera and ${rig.poses.length} poses of monitors. Arrow keys turn it, plus and minus scale it, 0 puts it back.`}
      />
      <figcaption class="row">
        {kSides.map(([text, yaw, pitch]) => (
          <button key={text} class="inline" onClick={() => setOrbit(orbitAround(placesOf(rig), yaw, pitch))}>
            {text}
          </button>
        ))}
        <button class="inline" onClick={() => setOrbit(fromCamera(rig))}>
          From the camera
        </button>
        {drawn.rays &&
          kRayStates.map((state) => (
            <label key={state} class={`ray-key ray-${state}`}>
              <input type="checkbox" checked={!hidden.has(state)} onChange={() => toggle(state)} />
              <svg viewBox="0 0 16 4" aria-hidden="true">
                <path d="M0 2H16" />
              </svg>
              {state} <span class="digits">{drawn.rays![state].length}</span>
            </label>
          ))}
      </figcaption>
    </figure>
  );
}
