import { useEffect, useRef, useState } from "preact/hooks";
import type uPlot from "uplot";
import { colourOf, useDark } from "./colours";
import { rangeOf, ticksTo, timeStepOf } from "./ticks";

export interface ChartLine {
  label: string;
  token: string; // the colour's name in style.css
  width?: number;
}

export interface ChartProps {
  /** For screen readers. */
  label: string;
  /** Seconds since 1970, and a row for each line. Missing numbers are null. */
  data: uPlot.AlignedData;
  lines: ChartLine[];
  /** The lines between which to fill, counted from 1: [upper, lower]. */
  band?: [number, number];
  height?: number;
  text: (value: number) => string;
}

function axisOf(grid: boolean): uPlot.Axis {
  return {
    stroke: colourOf("--faint"),
    grid: { show: grid, stroke: colourOf("--line"), width: 1 },
    ticks: { show: true, stroke: colourOf("--faint"), width: 1, size: 4 },
    font: "12px system-ui",
  };
}

const kMaxTimes = 5,
  kMinTimeSpace_px = 64,
  kMinValueSpace_px = 22,
  kValueAxis_px = 76;

/** Times at round distances from the newest one. */
function timesBack(plot: uPlot): number[] {
  const times = plot.data[0];
  const [first = 0, last = 0] = [times[0], times.at(-1)];
  const room = Math.max(1, Math.floor((plot.width - kValueAxis_px) / kMinTimeSpace_px) - 1);
  return ticksTo(last - first, timeStepOf(last - first, Math.min(kMaxTimes, room)))
    .map((back) => last - back)
    .reverse();
}

function agoText(seconds: number): string {
  if (seconds < 0.5) return "now";
  return seconds < 120 ? `${Math.round(seconds)} s ago` : `${Math.round(seconds / 60)} min ago`;
}

function optionsOf(props: ChartProps, width: number): uPlot.Options {
  return {
    width,
    height: props.height ?? 140,
    legend: { show: false },
    cursor: { show: false },
    axes: [
      {
        ...axisOf(false),
        size: 28,
        splits: timesBack,
        values: (plot, times) => times.map((time) => agoText(plot.data[0].at(-1)! - time)),
      },
      { ...axisOf(true), size: kValueAxis_px, space: kMinValueSpace_px, values: (_, values) => values.map(props.text) },
    ],
    scales: {
      y: {
        range: (_, low, high) => rangeOf(low, high),
      },
    },
    series: [
      {},
      ...props.lines.map(({ label, token, width: line }) => ({
        label,
        stroke: colourOf(token),
        width: line ?? 1.5,
        points: { show: false },
      })),
    ],
    ...(props.band && { bands: [{ series: props.band, fill: colourOf("--band") }] }),
  };
}

/** Lines over time. The chart library is loaded with the first chart. */
export function Chart(props: ChartProps) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | undefined>(undefined);
  const newest = useRef(props);
  newest.current = props;
  const [ready, setReady] = useState(false);
  const dark = useDark();
  useEffect(() => {
    const element = box.current!;
    let gone = false;
    const fit = new ResizeObserver(() =>
      plot.current?.setSize({ width: element.clientWidth, height: newest.current.height ?? 140 }),
    );
    void Promise.all([import("uplot"), import("uplot/dist/uPlot.min.css")]).then(([{ default: Plot }]) => {
      if (gone) return;
      plot.current = new Plot(optionsOf(newest.current, element.clientWidth), newest.current.data, element);
      fit.observe(element);
      setReady(true);
    });
    return () => {
      gone = true;
      fit.disconnect();
      plot.current?.destroy();
      plot.current = undefined;
    };
  }, [dark]);
  useEffect(() => plot.current?.setData(props.data), [props.data, ready]);
  return (
    <div
      ref={box}
      class="chart-box"
      role="img"
      aria-label={props.label}
      style={{ minHeight: `${props.height ?? 140}px` }}
    />
  );
}
