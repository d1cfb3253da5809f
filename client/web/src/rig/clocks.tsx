import { Chart, type ChartLine } from "../parts/chart";
import type { NodeJson } from "../gen/glasswing/v1/node_service_pb";
import { nanosecondsText } from "../parts/words";

const kMax = 900; // samples kept, one per second

interface History {
  first_ns: number; // reference of the other offsets: clocks count from the start of their machines
  time: number[];
  offset: number[];
  above: number[];
  below: number[];
}
// Kept across pages.
const histories = new Map<string, History>();

export function keepClocks(nodes: NodeJson[], now: number): void {
  for (const { name = "", clock } of nodes) {
    if (!clock) continue;
    const offset = Number(clock.offsetNs ?? 0),
      bound = Number(clock.boundNs ?? 0);
    let history = histories.get(name);
    if (!history)
      histories.set(name, (history = { first_ns: offset, time: [], offset: [], above: [], below: [] }));
    const { first_ns } = history;
    const columns: [number[], number][] = [
      [history.time, now - Number(clock.ageS ?? 0)],
      [history.offset, offset - first_ns],
      [history.above, offset - first_ns + bound],
      [history.below, offset - first_ns - bound],
    ];
    if ((history.time.at(-1) ?? 0) >= columns[0]![1]) continue; // not measured since
    for (const [column, value] of columns) {
      column.push(value);
      if (column.length > kMax) column.shift();
    }
  }
}

const kLines: ChartLine[] = [
  { label: "at most", token: "--band-edge", width: 1 },
  { label: "at least", token: "--band-edge", width: 1 },
  { label: "offset", token: "--accent" },
];

export function ClockCharts({ nodes }: { nodes: NodeJson[] }) {
  const shown = nodes.filter(({ name = "", clock }) => clock && (histories.get(name)?.time.length ?? 0) > 1);
  if (shown.length === 0) return null;
  return (
    <section class="card clocks">
      <h2>Clocks</h2>
      <p class="note">
        The offset of each node's clock from the server's since this page was opened, and its bounds.
      </p>
      <div class="charts">
        {shown.map(({ name = "", clock }) => {
          const { time, offset, above, below, first_ns } = histories.get(name)!;
          return (
            <figure key={name}>
              <figcaption>
                <b>{name}</b> <span class="digits">± {nanosecondsText(Number(clock?.boundNs ?? 0))}</span>
                {Math.abs(first_ns) >= 1e6 && <span class="note"> from {nanosecondsText(first_ns)}</span>}
              </figcaption>
              <Chart
                label={`Clock of ${name} over the last minutes`}
                data={[[...time], [...above], [...below], [...offset]]}
                lines={kLines}
                band={[1, 2]}
                text={nanosecondsText}
                height={130}
              />
            </figure>
          );
        })}
      </div>
    </section>
  );
}
