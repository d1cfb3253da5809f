import { useState } from "preact/hooks";
import type { NodeJson } from "../gen/glasswing/v1/node_service_pb";
import { State } from "../parts/state";
import { bytesText, plainName } from "../parts/words";
import { offsetText } from "./clock_history";
import { LogDialog } from "./log";
import { preparationText } from "./preparation";
import { programOf, usualProgram } from "./programs";

function Disk({ node: { health } }: { node: NodeJson }) {
  const total = Number(health?.totalBytes ?? 0);
  if (total === 0) return <>–</>;
  const free = Number(health?.freeBytes ?? 0);
  return (
    <span class="disk">
      <meter min={0} max={total} low={0.1 * total} optimum={total} value={free} aria-label="Disk free" />
      {bytesText(free)} of {bytesText(total)}
    </span>
  );
}

function Clock({ node: { clock } }: { node: NodeJson }) {
  return <>{clock ? offsetText(clock) : "–"}</>;
}

function Program({ node, usual }: { node: NodeJson; usual: string }) {
  const own = programOf(node);
  return own === usual ? (
    <>{own}</>
  ) : (
    <span class="caution-text" title={`The others are ${usual}: install the same everywhere`}>
      {own} (others: {usual})
    </span>
  );
}

function NodeState({ node: { preparation, up } }: { node: NodeJson }) {
  if (preparation) return <State kind="busy">preparing</State>;
  return <State kind={up ? "good" : "bad"}>{up ? "up" : "away"}</State>;
}

export function Nodes({ nodes }: { nodes: NodeJson[] }) {
  const usual = usualProgram(nodes);
  const [read, setRead] = useState<{ node?: string }>(); // whose log is shown
  return (
    <>
      {nodes.length === 0 && <p>No node has registered with the server yet.</p>}
      {nodes.length > 0 && (
        <table class="stack">
          <thead>
            <tr>
              <th>Node</th>
              <th>State</th>
              <th>Description</th>
              <th>Address</th>
              <th>Program</th>
              <th>Disk free</th>
              <th>Clock offset</th>
              <th>Temperature</th>
              <th>Log</th>
            </tr>
          </thead>
          <tbody>
            {nodes.map((node) => (
              <tr key={node.name}>
                <td data-label="Node">
                  <b>{node.name}</b> <span class="note">{plainName(node.kind, "NODE_KIND_")}</span>
                </td>
                <td data-label="State">
                  <NodeState node={node} />
                </td>
                <td data-label="Description">
                  {node.preparation && <b>{preparationText(node.preparation)}; </b>}
                  {node.detail || "–"}
                </td>
                <td data-label="Address" class="digits">
                  {node.address || "–"}
                </td>
                <td data-label="Program" class="digits">
                  <Program node={node} usual={usual} />
                </td>
                <td data-label="Disk free">
                  <Disk node={node} />
                </td>
                <td data-label="Clock offset" class="digits">
                  <Clock node={node} />
                </td>
                <td data-label="Temperature">
                  {node.health?.temperatureC === undefined
                    ? "–"
                    : `${Number(node.health.temperatureC).toFixed(0)} °C`}
                </td>
                <td data-label="Log">
                  {node.address ? (
                    <button
                      class="inline"
                      aria-label={`Log of ${node.name}`}
                      onClick={() => setRead({ node: node.name! })}
                    >
                      Log…
                    </button>
                  ) : (
                    "–"
                  )}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      <button class="quiet" onClick={() => setRead({})}>
        Log of the server…
      </button>
      {read && <LogDialog {...read} close={() => setRead(undefined)} />}
    </>
  );
}
