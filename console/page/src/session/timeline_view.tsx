import { useEffect, useRef } from "preact/hooks";
import { colourOf, useDark } from "../parts/colours";
import { stepOf, ticksTo, timeStepOf, timeTickText } from "../parts/ticks";
import { columnsOf, kRetaken, kStates, type StepState, type Timeline } from "./timeline";

const kTokens: Record<StepState, string> = {
  lost: "--bad",
  planned: "--line",
  shown: "--faint",
  imported: "--faint",
  time: "--accent",
  patch: "--good",
};
const kWords: Record<StepState, string> = {
  lost: "lost",
  planned: "planned",
  shown: "shown, not proven yet",
  imported: "imported",
  time: "proven by time alone",
  patch: "proven by time and id patch",
};
const kStrip = 22,
  kTicks = 6,
  kSpace = 20; // CSS px: the strip of steps, its marks for retakes, and the gap to the plot with the times
const kMaxTicks = 5,
  kMinTick_px = 90; // between times

/** Lines at round times and steps, with what they are. */
function drawGrid(
  pen: CanvasRenderingContext2D,
  { stepCount }: Timeline,
  last_s: number,
  plot: number,
  x: (time: number) => number,
  y: (step: number) => number,
): void {
  const scale = devicePixelRatio;
  const { width } = pen.canvas;
  const times = ticksTo(last_s, timeStepOf(last_s, Math.min(10, Math.floor(width / scale / kMinTick_px))));
  const steps = ticksTo(stepCount - 1, stepOf(stepCount, kMaxTicks)).slice(1);
  pen.fillStyle = colourOf("--line");
  for (const time of times) pen.fillRect(x(time), 0, scale, plot + 3 * scale);
  for (const step of steps) pen.fillRect(0, y(step), width, scale);
  pen.fillStyle = colourOf("--faint");
  pen.font = `${11 * scale}px system-ui`;
  pen.textBaseline = "top";
  for (const time of times) {
    const text = timeTickText(time);
    const right = width - pen.measureText(text).width;
    pen.fillText(text, Math.min(right, x(time)), plot + 4 * scale);
  }
  pen.textBaseline = "bottom";
  for (const step of steps) pen.fillText(`step ${step.toLocaleString("en")}`, 2 * scale, y(step));
}

/** Each event by time and step, above `plot` px, and the limit of the display as a dashed line. */
function drawEvents(
  pen: CanvasRenderingContext2D,
  timeline: Timeline,
  limit: number | undefined,
  plot: number,
): void {
  const scale = devicePixelRatio;
  const { width } = pen.canvas;
  const { seconds, steps, kinds } = timeline.events;
  const fastest = limit === undefined ? 0 : timeline.stepCount / limit;
  const last = Math.max(1, timeline.seconds, fastest);
  const x = (time: number): number => (time / last) * (width - 4 * scale);
  const y = (step: number): number =>
    plot - 3 * scale - (step / Math.max(1, timeline.stepCount - 1)) * (plot - 6 * scale);

  drawGrid(pen, timeline, last, plot, x, y);
  pen.fillStyle = colourOf("--faint");
  pen.fillRect(0, plot, width, scale);
  if (fastest > 0) {
    pen.strokeStyle = colourOf("--faint");
    pen.lineWidth = scale;
    pen.setLineDash([5 * scale, 5 * scale]);
    pen.beginPath();
    pen.moveTo(x(0), y(0));
    pen.lineTo(x(fastest), y(timeline.stepCount - 1));
    pen.stroke();
  }
  const dot = kinds.length > 4000 ? 2 : 3;
  const marks: [number, string, number][] = [
    [kStates.indexOf("shown"), "--line", dot],
    [kRetaken, "--caution", dot + 1],
    [kStates.indexOf("imported"), "--faint", dot],
    [kStates.indexOf("time"), "--accent", dot],
    [kStates.indexOf("patch"), "--good", dot],
    [kStates.indexOf("lost"), "--bad", dot + 1],
  ];
  for (const [kind, token, size] of marks) {
    pen.fillStyle = colourOf(token);
    const side = size * scale;
    for (let i = 0; i < kinds.length; ++i) {
      if (kinds[i] === kind) pen.fillRect(x(seconds[i]!), y(steps[i]!) - side / 2, side, side);
    }
  }
}

/** Each step in its place, in the strip at the bottom, with marks for retakes above it. */
function drawSteps(
  pen: CanvasRenderingContext2D,
  timeline: Timeline,
  selected: number | undefined,
  strip: number,
  ticks: number,
): void {
  const scale = devicePixelRatio;
  const { width, height } = pen.canvas;
  const columns = Math.min(timeline.stepCount, Math.floor(width));
  const { states, retaken } = columnsOf(timeline, columns);
  const wide = width / columns;
  const edge = (column: number): number => Math.round(column * wide);
  for (const [state, name] of kStates.entries()) {
    pen.fillStyle = colourOf(kTokens[name]);
    for (let i = 0; i < columns; ++i)
      if (states[i] === state) pen.fillRect(edge(i), height - strip, edge(i + 1) - edge(i), strip);
  }
  pen.fillStyle = colourOf("--caution");
  for (let i = 0; i < columns; ++i)
    if (retaken[i]) pen.fillRect(i * wide, height - strip - ticks, Math.max(wide, 2 * scale), ticks - scale);
  if (selected !== undefined) {
    pen.fillStyle = colourOf("--ink");
    pen.fillRect(
      ((selected + 0.5) / timeline.stepCount) * width - scale,
      height - strip - ticks,
      2 * scale,
      strip + ticks,
    );
  }
}

function draw(
  pen: CanvasRenderingContext2D,
  timeline: Timeline,
  limit: number | undefined,
  selected: number | undefined,
): void {
  const { width, height } = pen.canvas;
  const strip = kStrip * devicePixelRatio,
    ticks = kTicks * devicePixelRatio;
  pen.clearRect(0, 0, width, height);
  drawEvents(pen, timeline, limit, height - strip - ticks - kSpace * devicePixelRatio);
  drawSteps(pen, timeline, selected, strip, ticks);
}

function Legend({ timeline }: { timeline: Timeline }) {
  return (
    <ul class="keys">
      {kStates.map(
        (state, i) =>
          timeline.counts[i]! > 0 && (
            <li key={state}>
              <span class={`key-mark ${state}`} /> {timeline.counts[i]!.toLocaleString("en")} {kWords[state]}
            </li>
          ),
      )}
      {timeline.retaken > 0 && (
        <li>
          <span class="key-mark retaken" /> {timeline.retaken.toLocaleString("en")} times shown again
        </li>
      )}
    </ul>
  );
}

interface Props {
  timeline: Timeline;
  /** Changes whenever the timeline grows. */
  version: number;
  /** Steps per second that the display allows; undefined: not known. */
  limit: number | undefined;
  selected: number | undefined;
  select: (step: number) => void;
}

export function TimelineView({ timeline, version, limit, selected, select }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const dark = useDark();
  const drawing = useRef<() => void>(() => undefined);
  drawing.current = () => {
    const pen = canvas.current?.getContext("2d");
    if (!pen) return;
    const { clientWidth, clientHeight } = pen.canvas;
    const [width, height] = [
      Math.round(clientWidth * devicePixelRatio),
      Math.round(clientHeight * devicePixelRatio),
    ];
    if (pen.canvas.width !== width || pen.canvas.height !== height)
      [pen.canvas.width, pen.canvas.height] = [width, height];
    if (width > 0) draw(pen, timeline, limit, selected);
  };
  useEffect(() => {
    const frame = requestAnimationFrame(() => drawing.current());
    return () => cancelAnimationFrame(frame);
  }, [timeline, version, limit, selected, dark]);
  useEffect(() => {
    const resized = new ResizeObserver(() => drawing.current());
    resized.observe(canvas.current!);
    return () => resized.disconnect();
  }, []);
  const pick = (event: MouseEvent): void => {
    const box = canvas.current!.getBoundingClientRect();
    const place = (event.clientX - box.left) / box.width;
    if (event.clientY > box.bottom - kStrip - kTicks)
      select(Math.min(timeline.stepCount - 1, Math.max(0, Math.floor(place * timeline.stepCount))));
  };
  const proven = timeline.provenAt.length;
  return (
    <figure class="timeline">
      <canvas
        ref={canvas}
        onClick={pick}
        role="img"
        aria-label={`Timeline: ${proven} of ${timeline.stepCount} steps are proven, ${timeline.retaken} times a step was shown again`}
      />
      <figcaption class="note">
        Above: the events, by time (to the right) and step (upwards)
        {limit !== undefined && "; the dashed line is the limit of the display"}. Below: the state of each step;
        click one to see its frame.
      </figcaption>
      <Legend timeline={timeline} />
    </figure>
  );
}
