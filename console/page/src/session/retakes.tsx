import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { countText } from "../parts/words";
import type { Timeline } from "./timeline";

/** The reasons for retakes, the last retakes, and the steps without proof. */
export function Retakes({
  session,
  timeline,
  select,
}: {
  session: SessionJson;
  timeline: Timeline | undefined;
  select: (step: number) => void;
}) {
  const unproven = session.unproven ?? [];
  if (!timeline?.retaken && unproven.length === 0) return null;
  const stepButton = (step: number) => (
    <button class="quiet link" onClick={() => select(step)}>
      step {step}
    </button>
  );
  return (
    <section class="card">
      {unproven.length > 0 && (
        <>
          <h2>Without proof: {countText(unproven.length, "step")}</h2>
          <ul class="steps">
            {unproven.slice(0, 100).map(({ step = 0, what }) => (
              <li key={step}>
                <span class="digits">{step}</span> {what}
              </li>
            ))}
          </ul>
        </>
      )}
      {timeline && timeline.retaken > 0 && (
        <>
          <h2>Steps shown again: {countText(timeline.retaken, "time")}</h2>
          <ul class="reasons">
            {[...timeline.reasons]
              .sort((a, b) => b[1] - a[1])
              .map(([why, count]) => (
                <li key={why}>
                  <b class="digits">{count.toLocaleString("en")}</b> {why || "no reason given"}
                </li>
              ))}
          </ul>
          <details>
            <summary>Show the last {Math.min(timeline.retaken, timeline.retakes.length)}</summary>
            <ul class="steps">
              {timeline.retakes.map(({ step, seconds, why }, i) => (
                <li key={i}>
                  <span class="digits">{seconds.toFixed(1)} s</span> {stepButton(step)} {why}
                </li>
              ))}
            </ul>
          </details>
        </>
      )}
    </section>
  );
}
