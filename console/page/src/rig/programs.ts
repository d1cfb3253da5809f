import type { NodeJson } from "../gen/glasswing/v1/node_service_pb";

/** "0.1.0, 35dcd9a3" */
export function programOf({ version, build }: NodeJson): string {
  return `${version ?? "unknown"}${build ? `, ${build}` : ""}`;
}

/** The most frequent program among the nodes; the first among equals. */
export function usualProgram(nodes: NodeJson[]): string {
  const counts = new Map<string, number>();
  for (const node of nodes) counts.set(programOf(node), (counts.get(programOf(node)) ?? 0) + 1);
  return [...counts].reduce((most, each) => (each[1] > most[1] ? each : most), ["", 0])[0];
}
