import type { SessionJson } from "../gen/glasswing/v1/session_pb";
import type { ListSessionsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { polled, useFeed } from "../parts/feed";
import { placeOf, posesOf, seriesOf, type Pose, type Series } from "./series";

const kLookAgain_s = 3;
const kRadius = 44;

function Dot({ pose, here, size }: { pose: Pose; here: boolean; size: number }) {
  const { x, y } = placeOf(pose.position_deg, kRadius);
  const text = `${pose.session}: ${pose.position_deg}°, ${pose.state}`;
  return (
    <a href={`#/session/${encodeURIComponent(pose.session)}`} aria-label={text} aria-current={here ? "page" : undefined}>
      <circle class={`pose ${pose.state}`} cx={x} cy={y} r={here ? 1.5 * size : size}>
        <title>{text}</title>
      </circle>
    </a>
  );
}

function Ring({ series, here }: { series: Series; here: string }) {
  const { value } = useFeed(
    (signal) =>
      polled<ListSessionsResponseJson>("SessionService/ListSessions", { tags: [series.name] }, kLookAgain_s, {
        signal,
      }),
    [series.name],
  );
  if (!value) return null;
  const poses = posesOf(series, value.sessions ?? []);
  const number = (state: Pose["state"]): number => poses.filter((pose) => pose.state === state).length;
  const size = Math.min(4, (Math.PI * kRadius) / Math.max(series.count, poses.length, 1) / 1.5);
  const counts = [
    `${number("captured")} of ${series.count} captured`,
    ...(number("running") ? [`${number("running")} running`] : []),
    ...(number("flagged") ? [`${number("flagged")} flagged`] : []),
  ];
  return (
    <section class="card">
      <h2>Poses of {series.name}</h2>
      <div class="pose-ring">
        <svg viewBox="-52 -52 104 104" role="group" aria-label={`The poses of ${series.name}, seen from above`}>
          <circle class="track" r={kRadius} />
          <text y="2" text-anchor="middle">
            {series.axis}
          </text>
          {poses.map((pose) => (
            <Dot key={pose.session} pose={pose} here={pose.session === here} size={size} />
          ))}
        </svg>
        <p>
          {counts.join(", ")}
          <span class="note">Seen from above, the camera below. Each dot is a session.</span>
        </p>
      </div>
    </section>
  );
}

/** The ring of poses of the series that a session belongs to; nothing if there is none. */
export function PoseRing({ session }: { session: SessionJson }) {
  const series = seriesOf(session);
  return series ? <Ring series={series} here={session.name ?? ""} /> : null;
}
