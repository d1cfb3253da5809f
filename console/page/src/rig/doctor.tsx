import { useEffect, useRef, useState } from "preact/hooks";
import { mayOperate, stream } from "../api";
import type { CheckRigResponseJson, FindingJson } from "../gen/glasswing/v1/rig_service_pb";
import { Failure } from "../parts/failure";
import { Message } from "../parts/message";
import { State } from "../parts/state";
import { useAction } from "../parts/use_action";

function FindingState({ level }: { level: FindingJson["level"] }) {
  if (level === "FINDING_LEVEL_PROBLEM") return <State kind="bad">problem</State>;
  if (level === "FINDING_LEVEL_WARNING") return <State kind="caution">warning</State>;
  return <State kind="good">ok</State>;
}

/** The result in one sentence. */
export function verdict(findings: FindingJson[]): string {
  const problems = findings.filter(({ level }) => level === "FINDING_LEVEL_PROBLEM").length;
  const warnings = findings.filter(({ level }) => level === "FINDING_LEVEL_WARNING").length;
  if (problems > 0)
    return `A capture would fail: ${problems === 1 ? "one problem" : `${problems} problems`}.`;
  if (warnings > 0)
    return `A capture works; ${warnings === 1 ? "one thing" : `${warnings} things`} could be better.`;
  return "No problems found.";
}

export function Doctor() {
  const [findings, setFindings] = useState<FindingJson[]>([]);
  const [done, setDone] = useState(false);
  const { busy, error, act } = useAction();
  const cancel = useRef<AbortController | undefined>(undefined);
  useEffect(() => () => cancel.current?.abort(), []);
  if (!mayOperate.value) return null;
  const check = async (): Promise<void> => {
    setFindings([]);
    setDone(false);
    cancel.current = new AbortController();
    for await (const { finding } of stream<CheckRigResponseJson>(
      "RigService/CheckRig",
      {},
      { signal: cancel.current.signal },
    )) {
      if (finding) setFindings((all) => [...all, finding]);
    }
    setDone(true);
  };
  return (
    <section id="check" class="card doctor">
      <div class="row">
        <h2>Check the rig</h2>
        <button onClick={() => void act(check)} disabled={busy}>
          {busy ? "Checking…" : "Check"}
        </button>
        {done && <b role="status">{verdict(findings)}</b>}
      </div>
      {findings.length === 0 && !busy && (
        <p class="note">
          Shows and records some steps for a few seconds, as a capture would, and reports the findings.
        </p>
      )}
      {error !== undefined && <Failure error={error} />}
      <ul class="findings">
        {findings.map(({ level, subject, text, advice }, i) => (
          <li key={i}>
            <FindingState level={level} />
            <b>{subject}</b>
            <span>
              {text}
              {advice && (
                <span class="advice">
                  <Message text={advice} />
                </span>
              )}
            </span>
          </li>
        ))}
      </ul>
    </section>
  );
}
