import { kChannels, modesOf, type MatteData, type MatteMonitor, type Mode } from "../light/matte";

const kMargin = 0.06;

/** The ellipse of two standard deviations, or the box itself. */
function Footprint({ mode, isBox, ink, least }: { mode: Mode; isBox: boolean; ink: string; least: number }) {
  const mean = 0.5 * (mode.xx + mode.yy);
  const away = Math.hypot(0.5 * (mode.xx - mode.yy), mode.xy);
  const turn = (0.5 * Math.atan2(2 * mode.xy, mode.xx - mode.yy) * 180) / Math.PI;
  const [long, short] = [mean + away, Math.max(0, mean - away)].map((variance) => Math.max(least, 2 * Math.sqrt(variance)));
  const [width, height] = [mode.xx, mode.yy].map((variance) => Math.max(least, Math.sqrt(12 * variance))) as [number, number];
  return (
    <g class={`ink-${ink}`}>
      {isBox ? (
        <rect x={mode.x - width / 2} y={mode.y - height / 2} width={width} height={height} />
      ) : (
        <ellipse rx={long} ry={short} transform={`translate(${mode.x} ${mode.y}) rotate(${turn})`} />
      )}
    </g>
  );
}

/** A pixel's footprints on one monitor. */
export function FootprintMap({ matte, pixel, monitor, texture }: { matte: MatteData; pixel: number; monitor: MatteMonitor; texture: number }) {
  const margin = kMargin * Math.max(monitor.width_px, monitor.height_px);
  const view = [-margin, -margin, monitor.width_px + 2 * margin, monitor.height_px + 2 * margin].join(" ");
  const least = 0.004 * monitor.width_px;
  return (
    <figure class="footprints">
      <figcaption>{monitor.name}, {monitor.width_px}x{monitor.height_px}</figcaption>
      <svg viewBox={view} role="img" aria-label={`The pixel's footprints on monitor ${monitor.name}`}>
        <rect class="outline" width={monitor.width_px} height={monitor.height_px} />
        {kChannels.slice(0, matte.modeChannels).flatMap((ink, channel) =>
          modesOf(matte, pixel, channel)
            .filter((mode) => mode.texture === texture)
            .map((mode, i) => <Footprint key={`${ink}${i}`} mode={mode} isBox={matte.metadata.footprint === "box"} ink={matte.modeChannels === 1 ? "Y" : ink} least={least} />),
        )}
      </svg>
    </figure>
  );
}
