import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import { bytesText, secondsText } from "../parts/words";
import { recentRate, secondsLeft, stepLimit } from "./rates";
import { decibels, percent, Rounds } from "./rounds";
import { isCapturing, progressOf } from "./states";
import type { Timeline } from "./timeline";
import type { ArchiveView } from "./use_archive";

interface Fact {
  name: string;
  text: string;
  more?: string;
}

function rateFact(
  session: SessionJson,
  perSecond: number | undefined,
  limit: number | undefined,
): Fact | undefined {
  const taken = Number(session.captureSeconds ?? 0),
    proven = session.provenCount ?? 0;
  const rate = isCapturing(session)
    ? perSecond
    : taken > 0 && Number(session.framesTaken ?? 0) > 0
      ? proven / taken
      : undefined;
  if (rate === undefined) return undefined;
  const more =
    limit === undefined
      ? undefined
      : `the display allows ${limit.toFixed(1)}: ${((100 * rate) / limit).toFixed(0)} %`;
  return {
    name: isCapturing(session) ? "Rate now" : "Rate",
    text: `${rate.toFixed(1)} steps/s`,
    ...(more && { more }),
  };
}

function diskFact(session: SessionJson, { freeBytes }: ArchiveView): Fact | undefined {
  if (freeBytes === undefined) return undefined;
  const { provenCount = 0, stepCount = 0 } = session;
  const kept = Number(session.archiveBytes ?? 0);
  const needed = provenCount > 0 ? (kept / provenCount) * (stepCount - provenCount) : 0;
  const more = [
    kept > 0 && `${bytesText(kept)} kept`,
    needed > 0 && isCapturing(session) && `${bytesText(needed)} more needed`,
  ]
    .filter(Boolean)
    .join(", ");
  return { name: "Disk left", text: bytesText(freeBytes), ...(more && { more }) };
}

function factsOf(session: SessionJson, timeline: Timeline | undefined, archive: ArchiveView): Fact[] {
  const {
    provenCount = 0,
    stepCount = 0,
    patchProvenCount = 0,
    timeProvenCount = 0,
    retakenCount = 0,
    refusedCount = 0,
  } = session;
  // What waits has no rate, and nobody knows how long it takes.
  const advances = isCapturing(session) && !session.waiting;
  const perSecond =
    timeline && recentRate(timeline.provenAt, Math.max(timeline.seconds, Number(session.captureSeconds ?? 0)));
  const limit = stepLimit(session.plan, archive.manifest?.monitors ?? []);
  const left = advances ? secondsLeft(stepCount - provenCount, perSecond ?? limit) : undefined;
  const pixels = Number(session.objectPixelCount ?? 0),
    flagged = Number(session.flaggedPixelCount ?? 0),
    unsolved = Number(session.unsolvedPixelCount ?? 0);
  const judged = session.adapted?.at(-1);
  const facts: (Fact | false | undefined)[] = [
    {
      name: "Proven",
      text: `${provenCount.toLocaleString("en")} of ${stepCount.toLocaleString("en")}`,
      more:
        timeProvenCount > 0
          ? `${timeProvenCount.toLocaleString("en")} by time alone`
          : `${patchProvenCount.toLocaleString("en")} also by the id patch`,
    },
    {
      name: "Repeated",
      text: retakenCount.toLocaleString("en"),
      ...(refusedCount > 0 && { more: `${refusedCount} frames showed another id` }),
    },
    (advances || !isCapturing(session)) && rateFact(session, perSecond, limit),
    left !== undefined && { name: "Time left", text: secondsText(left) },
    !isCapturing(session) &&
      Number(session.captureSeconds ?? 0) > 0 && {
        name: "Captured in",
        text: secondsText(Number(session.captureSeconds)),
      },
    diskFact(session, archive),
    session.draft && {
      name: "Draft",
      text: `${(session.draft.imageCount ?? 0).toLocaleString("en")} of ${(session.draft.plannedImageCount ?? 0).toLocaleString("en")} images`,
      ...(session.draft.sweepCount && {
        more: `${session.draft.sweepCount} of ${session.draft.plannedSweepCount ?? 0} sweeps`,
      }),
    },
    judged && {
      name: "Known well enough",
      text: `${percent(judged.knownShare)} of the object`,
      more: `after ${(judged.imageCount ?? 0).toLocaleString("en")} images; 95 % to ${decibels(judged.errorDb)}`,
    },
    judged?.anyShape && {
      name: "Of any shape",
      text: `${(100 * Number(judged.anyShape.share ?? 0)).toFixed(0)} % of the object`,
      more: `${percent(judged.anyShape.knownShare)} of these known; 95 % to ${decibels(judged.anyShape.errorDb)}`,
    },
    pixels > 0 && {
      name: "Object",
      text: `${pixels.toLocaleString("en")} pixels`,
      more:
        `${flagged.toLocaleString("en")} flagged as unreliable` +
        (unsolved > 0 ? `, ${unsolved.toLocaleString("en")} pixels of the picture not solved` : ""),
    },
    Number(session.solveSeconds ?? 0) > 0 && {
      name: "Solved in",
      text: secondsText(Number(session.solveSeconds)),
      ...(session.method && { more: session.method }),
    },
  ];
  return facts.filter((fact): fact is Fact => Boolean(fact));
}

export function Progress({
  session,
  timeline,
  archive,
}: {
  session: SessionJson;
  timeline: Timeline | undefined;
  archive: ArchiveView;
}) {
  const progress = progressOf(session);
  return (
    <>
      {progress && (
        <div class="progress">
          {progress.count > 0 ? (
            <progress value={progress.done} max={progress.count} aria-label={`${progress.what} done`} />
          ) : (
            <progress aria-label="in progress" />
          )}
          <span class="digits">
            {progress.count > 0
              ? `${progress.done.toLocaleString("en")} of ${progress.count.toLocaleString("en")} ${progress.what}`
              : "estimating the work"}
          </span>
        </div>
      )}
      <dl class="figures">
        {factsOf(session, timeline, archive).map(({ name, text, more }) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>
              {text}
              {more && <span class="note"> {more}</span>}
            </dd>
          </div>
        ))}
      </dl>
      <Rounds rounds={session.adapted ?? []} />
    </>
  );
}
