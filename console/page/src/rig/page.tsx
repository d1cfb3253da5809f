import { useEffect } from "preact/hooks";
import type { ListNodesResponseJson } from "../gen/glasswing/v1/node_service_pb";
import type { PageProps } from "../pages";
import { FeedFailure } from "../parts/silence";
import { polled, useFeed } from "../parts/feed";
import { Message } from "../parts/message";
import { ClockCharts, keepClocks } from "./clocks";
import { Doctor } from "./doctor";
import { Holder } from "./holder";
import { Nodes } from "./nodes";
import { Pattern } from "./pattern";
import { Preview } from "./preview";
import "./rig.css";

async function* nodesWithHistory(signal: AbortSignal): AsyncGenerator<ListNodesResponseJson> {
  for await (const answer of polled<ListNodesResponseJson>("NodeService/ListNodes", {}, 1, { signal })) {
    yield answer; // first: the nodes are not to wait for the clocks' history
    await keepClocks(answer.nodes ?? [], signal);
  }
}

/** `path`: the section to show: "check" or "pattern". */
export default function Page({ path: [section = ""] }: PageProps) {
  useEffect(() => document.getElementById(section)?.scrollIntoView(), [section]);
  const { value, live, error } = useFeed(nodesWithHistory, []);
  const nodes = value?.nodes ?? [];
  const cameras = nodes.filter(({ kind }) => kind === "NODE_KIND_CAMERA").map(({ name = "" }) => name);
  return (
    <div class="rig">
      <div class="row">
        <h1>Rig</h1>
        {value && <Holder holder={value.holder} />}
      </div>
      {!live && <FeedFailure error={error} />}
      {value?.problems?.map((problem) => (
        <p key={problem} class="caution-text">
          <Message text={problem} />
        </p>
      ))}
      <Preview cameras={cameras} />
      <section class={live || !value ? "card nodes" : "card nodes stale"}>
        <h2>Nodes</h2>
        {value && <Nodes nodes={nodes} />}
      </section>
      <ClockCharts nodes={nodes} />
      <Pattern />
      <Doctor />
    </div>
  );
}
