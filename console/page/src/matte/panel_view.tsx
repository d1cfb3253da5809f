import { useEffect, useRef } from "preact/hooks";
import type { Panel, Raster } from "./panels";

export interface Place {
  x: number;
  y: number;
}

export function Picture({ raster, class: name }: { raster: Raster; class: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const { width, height, pixels } = raster;
    canvas.current!.width = width;
    canvas.current!.height = height;
    canvas.current!.getContext("2d")!.putImageData(new ImageData(pixels, width, height), 0, 0);
  }, [raster]);
  return <canvas ref={canvas} class={name} aria-hidden="true" />;
}

function Legend({ panel: { keys, bar } }: { panel: Panel }) {
  return (
    <div class="legend">
      {bar && (
        <div class="scale">
          <Picture raster={bar.colours} class="ramp" />
          {bar.ticks.map(({ place, label }) => (
            <span key={label} class="tick digits" style={{ left: `${100 * place}%` }}>
              {label}
            </span>
          ))}
        </div>
      )}
      {keys.map(({ colours, name }) => (
        <span key={name} class="key">
          <Picture raster={colours} class={colours.width > 1 ? "chart" : "swatch"} />
          {name}
        </span>
      ))}
    </div>
  );
}

const kSteps: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};
const kLargeStep = 10;

interface PanelViewProps {
  panel: Panel;
  cursor: Place;
  /** `take`: the pixel was chosen; otherwise the cursor only hovers over it. */
  choose: (place: Place, take: boolean) => void;
}

export function PanelView({ panel, cursor, choose }: PanelViewProps) {
  const { width, height } = panel.picture;
  const click = (event: MouseEvent): void => {
    const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
    const x = Math.floor(((event.clientX - box.left) / box.width) * width);
    const y = Math.floor(((event.clientY - box.top) / box.height) * height);
    choose({ x: Math.min(width - 1, Math.max(0, x)), y: Math.min(height - 1, Math.max(0, y)) }, true);
  };
  const press = (event: KeyboardEvent): void => {
    const step = kSteps[event.key];
    if (!step && event.key !== "Enter") return;
    event.preventDefault();
    if (!step) return choose(cursor, true);
    const far = event.shiftKey ? kLargeStep : 1;
    const x = Math.min(width - 1, Math.max(0, cursor.x + far * step[0]));
    const y = Math.min(height - 1, Math.max(0, cursor.y + far * step[1]));
    choose({ x, y }, false);
  };
  const style = {
    left: `${(100 * (cursor.x + 0.5)) / width}%`,
    top: `${(100 * (cursor.y + 0.5)) / height}%`,
  };
  return (
    <figure class="panel card" data-panel={panel.name}>
      <figcaption>{panel.title}</figcaption>
      <div
        class="picture"
        tabIndex={0}
        role="application"
        aria-label={`${panel.title}. Arrow keys move the cursor, Enter shows its pixel.`}
        onClick={click}
        onKeyDown={press}
      >
        <Picture raster={panel.picture} class="pixels" />
        <span class="cursor" style={style} />
      </div>
      <Legend panel={panel} />
    </figure>
  );
}
