import { kChannels, modesOf, type MatteData, type MatteMonitor, type Mode } from "../light/matte";

const kMargin = 0.06;

/** The ellipse of two standard deviations, or the box itself. */
function Footprint({ mode, isBox, ink, least }: { mode: Mode; isBox: boolean; ink: string; least: number }) {
  const mean = 0.5 * (mode.xx + mode.yy);
  const away = Math.hypot(0.5 * (mode.xx - mode.yy), mode.xy);
  const turn = (0.5 * Math.atan2(2 * mode.xy, mode.xx - mode.yy) * 180) / Math.PI;
  const [long, short] = [mean + away, Math.max(0, mean - away)].map((variance) =>
    Math.max(least, 2 * Math.sqrt(variance)),
  );
  const [width, height] = [mode.xx, mode.yy].map((variance) => Math.max(least, Math.sqrt(12 * variance))) as [
    number,
    number,
  ];
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

interface View {
  x: number;
  y: number;
  width: number;
  height: number;
}

const kMinClose_px = 6;
const kMaxLines = 40;

function wholeOf({ width_px, height_px }: MatteMonitor): View {
  const margin = kMargin * Math.max(width_px, height_px);
  return { x: -margin, y: -margin, width: width_px + 2 * margin, height: height_px + 2 * margin };
}

/** A view box with all footprints, in the monitor's aspect ratio. */
function closeTo(modes: Mode[], { width_px, height_px }: MatteMonitor): View {
  const reach = (variance: number): number => 2.5 * Math.sqrt(variance);
  const [left, right] = [
    Math.min(...modes.map(({ x, xx }) => x - reach(xx))),
    Math.max(...modes.map(({ x, xx }) => x + reach(xx))),
  ];
  const [top, bottom] = [
    Math.min(...modes.map(({ y, yy }) => y - reach(yy))),
    Math.max(...modes.map(({ y, yy }) => y + reach(yy))),
  ];
  const width = Math.max(kMinClose_px, right - left, ((bottom - top) * width_px) / height_px);
  const height = (width * height_px) / width_px;
  return { x: 0.5 * (left + right - width), y: 0.5 * (top + bottom - height), width, height };
}

/** The grid of monitor pixels, if there are few. */
function gridOf({ x, y, width, height }: View, { width_px, height_px }: MatteMonitor): string {
  if (Math.max(width, height) > kMaxLines) return "";
  const [left, right] = [Math.max(0, Math.ceil(x)), Math.min(width_px, x + width)];
  const [top, bottom] = [Math.max(0, Math.ceil(y)), Math.min(height_px, y + height)];
  let path = "";
  for (let u = left; u <= right; ++u) path += `M${u} ${Math.max(0, y)}V${bottom}`;
  for (let v = top; v <= bottom; ++v) path += `M${Math.max(0, x)} ${v}H${right}`;
  return path;
}

interface MapProps {
  matte: MatteData;
  pixel: number;
  monitor: MatteMonitor;
  texture: number;
}

function Map({ matte, pixel, monitor, texture, view, title }: MapProps & { view: View; title: string }) {
  const isBox = matte.metadata.footprint === "box";
  return (
    <figure class="footprints">
      <figcaption>{title}</figcaption>
      <svg
        viewBox={`${view.x} ${view.y} ${view.width} ${view.height}`}
        role="img"
        aria-label={`The pixel's footprints: ${title}`}
      >
        <path class="grid" d={gridOf(view, monitor)} />
        <rect class="outline" width={monitor.width_px} height={monitor.height_px} />
        {kChannels.slice(0, matte.modeChannels).flatMap((channelName, channel) =>
          modesOf(matte, pixel, channel)
            .filter((mode) => mode.texture === texture)
            .map((mode, i) => (
              <Footprint
                key={`${channelName}${i}`}
                mode={mode}
                isBox={isBox}
                ink={matte.modeChannels === 1 ? "Y" : channelName}
                least={0.004 * view.width}
              />
            )),
        )}
      </svg>
    </figure>
  );
}

/** A pixel's footprints on one monitor, with a close-up if they are small. */
export function FootprintMaps(props: MapProps) {
  const { matte, pixel, monitor, texture } = props;
  const modes = [0, 1, 2]
    .flatMap((channel) => modesOf(matte, pixel, channel))
    .filter((mode) => mode.texture === texture);
  const close = modes.length > 0 ? closeTo(modes, monitor) : undefined;
  return (
    <>
      <Map
        {...props}
        view={wholeOf(monitor)}
        title={`${monitor.name}, ${monitor.width_px}x${monitor.height_px}`}
      />
      {close && close.width < 0.4 * monitor.width_px && (
        <Map
          {...props}
          view={close}
          title={`${monitor.name}, close: ${close.width.toFixed(0)}x${close.height.toFixed(0)} px`}
        />
      )}
    </>
  );
}
