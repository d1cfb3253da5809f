import { call } from "../api";
import type { GetClockHistoryResponseJson, NodeJson } from "../gen/glasswing/v1/node_service_pb";
import { Chart, type ChartLine } from "../parts/chart";
import { nanosecondsText } from "../parts/words";
import { offsetText, withOffset, type History } from "./clock_history";

// Kept across pages.
const histories = new Map<string, History>();

/** Adds the newest measurements, and of a node that was not known before those that the server keeps. */
export async function keepClocks(nodes: readonly NodeJson[], signal: AbortSignal): Promise<void> {
  for (const { name = "", clock } of nodes) {
    if (!clock) continue;
    if (!histories.has(name)) {
      const { offsets = [] } = await call<GetClockHistoryResponseJson>(
        "NodeService/GetClockHistory",
        { node: name },
        { signal },
      );
      const now = Date.now() / 1000;
      for (const each of offsets) histories.set(name, withOffset(histories.get(name), each, now));
    }
    histories.set(name, withOffset(histories.get(name), clock, Date.now() / 1000));
  }
}

const kLines: ChartLine[] = [
  { label: "at most", token: "--band-edge", width: 1 },
  { label: "at least", token: "--band-edge", width: 1 },
  { label: "change", token: "--accent" },
];

export function ClockCharts({ nodes }: { nodes: NodeJson[] }) {
  const shown = nodes.filter(({ name = "", clock }) => clock && (histories.get(name)?.time.length ?? 0) > 1);
  if (shown.length === 0) return null;
  return (
    <section class="card clocks">
      <h2>Clocks</h2>
      <p class="note">
        How the offset of each node's clock from the server's has changed in the last hour, with its bounds: by how much it was
        above the present one.
      </p>
      <div class="charts">
        {shown.map(({ name = "", clock }) => {
          const { time, offset, above, below } = histories.get(name)!;
          const since = (offsets: number[]): number[] => offsets.map((each) => each - offset.at(-1)!);
          return (
            <figure key={name}>
              <figcaption>
                <b>{name}</b> <span class="note">offset now</span> <span class="digits">{offsetText(clock!)}</span>
              </figcaption>
              <Chart
                label={`Change of the clock offset of ${name} in the last hour`}
                data={[[...time], since(above), since(below), since(offset)]}
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
