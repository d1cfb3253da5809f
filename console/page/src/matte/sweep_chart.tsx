import { useEffect, useRef } from "preact/hooks";
import { modesOf, type MatteData } from "../light/matte";
import { theme } from "../theme";
import { foretold, type Sweep } from "./stripes";

const kHeight_px = 220;
const kCurvePoints = 240;
const kInks = ["#d6403a", "#2a9d4a", "#3b78d8"];
const kNames = ["red", "green", "blue"];

type Column = (number | null)[];

/** r, then the samples and the predicted curve of each channel, at the r of both. */
function columnsOf(matte: MatteData, pixel: number, sweep: Sweep): [number[], ...Column[]] {
  const measured = new Map(sweep.points.map(({ r, radiance }) => [r, radiance]));
  const [first, last] = [sweep.points[0]!.r, sweep.points.at(-1)!.r];
  const between = Array.from(
    { length: kCurvePoints },
    (_, i) => first + ((last - first) * i) / (kCurvePoints - 1),
  );
  const places = [...new Set([...measured.keys(), ...between])].sort((a, b) => a - b);
  const columns = kNames.flatMap((_, channel): Column[] => {
    const modes = modesOf(matte, pixel, channel);
    const foreground = matte.foreground[3 * pixel + channel]!;
    return [
      places.map((r) => measured.get(r)?.[channel] ?? null),
      places.map((r) => foretold(modes, foreground, sweep.stripe, sweep.texture, r, channel)),
    ];
  });
  return [places, ...columns];
}

export function SweepChart({ matte, pixel, sweep }: { matte: MatteData; pixel: number; sweep: Sweep }) {
  const place = useRef<HTMLDivElement>(null);
  const shade = theme.value;
  useEffect(() => {
    let end: (() => void) | undefined;
    let over = false;
    void import("./plot").then(({ uPlot }) => {
      const element = place.current;
      if (over || !element) return;
      const { color, borderTopColor } = getComputedStyle(element);
      const axis = {
        stroke: color,
        grid: { stroke: borderTopColor, width: 1 },
        ticks: { stroke: borderTopColor, width: 1 },
      };
      const chart = new uPlot(
        {
          width: element.clientWidth,
          height: kHeight_px,
          legend: { show: false },
          scales: { x: { time: false } },
          axes: [
            { ...axis, label: "r, monitor px", labelSize: 20 },
            { ...axis, size: 55 },
          ],
          series: [
            { label: "r" },
            ...kNames.flatMap((name, c) => [
              {
                label: name,
                stroke: kInks[c]!,
                paths: () => null,
                points: { show: true, size: 4, fill: kInks[c]! },
              },
              { label: `${name}, predicted`, stroke: kInks[c]!, width: 1.5, points: { show: false } },
            ]),
          ],
        },
        columnsOf(matte, pixel, sweep),
        element,
      );
      const watch = new ResizeObserver(() =>
        chart.setSize({ width: element.clientWidth, height: kHeight_px }),
      );
      watch.observe(element);
      end = () => (watch.disconnect(), chart.destroy());
    });
    return () => {
      over = true;
      end?.();
    };
  }, [matte, pixel, sweep, shade]);
  return (
    <figure class="sweep">
      <figcaption>{sweep.title}</figcaption>
      <div
        ref={place}
        class="plot"
        role="img"
        aria-label={`Radiance over the position of the stripe: ${sweep.title}`}
      />
    </figure>
  );
}
