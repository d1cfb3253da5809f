// The measured curves of cameras and monitors: light over code, red, green and blue.

/** Shares of full scale, evenly spaced over the codes. */
export interface Curves {
  device: string;
  lines: number[][];
}

const kSize = { width: 220, height: 130, left: 34, top: 6, right: 6, bottom: 22 };
const kMaxPoints = 100;
const kTicks = [0, 0.5, 1];
const kColours = ["red", "green", "blue"];

const inner = {
  x: (code: number): number => kSize.left + code * (kSize.width - kSize.left - kSize.right),
  y: (light: number): number =>
    kSize.top + (1 - Math.min(1, Math.max(0, light))) * (kSize.height - kSize.top - kSize.bottom),
};

/** The points of an SVG polyline, at most some kMaxPoints of them, first and last included. */
export function pointsOf(line: number[]): string {
  const last = line.length - 1;
  const count = Math.min(kMaxPoints, line.length);
  return Array.from({ length: count }, (_, k) => {
    const at = count > 1 ? Math.round((k * last) / (count - 1)) : 0;
    return `${inner.x(at / Math.max(1, last)).toFixed(1)},${inner.y(line[at]!).toFixed(1)}`;
  }).join(" ");
}

const percent = (share: number): string => `${Math.round(100 * share)} %`;

function Curve({ device, lines }: Curves) {
  return (
    <figure class="curve">
      <figcaption>
        <b>{device}</b>
      </figcaption>
      <svg
        viewBox={`0 0 ${kSize.width} ${kSize.height}`}
        role="img"
        aria-label={`The light of ${device}'s codes: red, green and blue`}
      >
        {kTicks.map((tick) => (
          <g key={tick}>
            <line x1={inner.x(0)} x2={inner.x(1)} y1={inner.y(tick)} y2={inner.y(tick)} />
            <text x={kSize.left - 4} y={inner.y(tick) + 3} text-anchor="end">
              {percent(tick)}
            </text>
            <text x={inner.x(tick)} y={kSize.height - 9} text-anchor={tick === 1 ? "end" : "middle"}>
              {percent(tick)}
            </text>
          </g>
        ))}
        {lines.map((line, c) => (
          <polyline key={c} class={kColours[c]} points={pointsOf(line)} />
        ))}
      </svg>
    </figure>
  );
}

export function CurveCharts({ curves }: { curves: Curves[] }) {
  if (curves.length === 0) return null;
  return (
    <>
      <h3>Light over code</h3>
      <div class="charts">
        {curves.map((each) => (
          <Curve key={each.device} {...each} />
        ))}
      </div>
    </>
  );
}
