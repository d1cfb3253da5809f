import type {
  FleetSolveJson,
  FleetSolverJson,
  GetFleetResponseJson,
} from "../gen/glasswing/v1/fleet_service_pb";
import { FeedFailure } from "../parts/silence";
import { polled, useFeed } from "../parts/feed";
import { Message } from "../parts/message";
import { State } from "../parts/state";
import { countText, secondsText } from "../parts/words";
import "./fleet.css";

function rateText(perSecond: number | string | undefined): string {
  return Number(perSecond ?? 0) > 0 ? Number(perSecond).toFixed(2) : "–";
}

function SolverState({ solver: { up, refused } }: { solver: FleetSolverJson }) {
  if (!up) return <State kind="bad">away</State>;
  return refused ? <State kind="caution">gets no work</State> : <State kind="good">up</State>;
}

function Leases({ solver: { leases = [], up, refused } }: { solver: FleetSolverJson }) {
  if (leases.length === 0) return <span class="note">{up && !refused ? "waiting for work" : "–"}</span>;
  return (
    <ul class="leases">
      {leases.map(({ session, tile = 0, attempt = 0, seconds, twice }) => (
        <li key={`${session} ${tile}`}>
          <a href={`#/session/${encodeURIComponent(session ?? "")}`}>{session}</a> tile {tile},{" "}
          {secondsText(Number(seconds ?? 0))}
          {attempt > 1 && `, attempt ${attempt}`}
          {twice && <span class="note"> (also being solved elsewhere)</span>}
        </li>
      ))}
    </ul>
  );
}

function Solvers({ solvers }: { solvers: readonly FleetSolverJson[] }) {
  if (solvers.length === 0)
    return (
      <p>
        No solver was seen in the last ten minutes. Start some with <code>glasswing-solver</code>.
      </p>
    );
  return (
    <table class="stack">
      <thead>
        <tr>
          <th>Solver</th>
          <th>State</th>
          <th>Works on</th>
          <th class="number">Tiles/s</th>
          <th class="number">Done</th>
          <th class="number">Failed</th>
          <th>Machine</th>
          <th>Problem</th>
        </tr>
      </thead>
      <tbody>
        {solvers.map((solver) => (
          <tr key={solver.name}>
            <td data-label="Solver">
              <b>{solver.name}</b>
            </td>
            <td data-label="State">
              <SolverState solver={solver} />
            </td>
            <td data-label="Works on">
              <Leases solver={solver} />
            </td>
            <td data-label="Tiles/s" class="digits number">
              {rateText(solver.tilesPerSecond)}
            </td>
            <td data-label="Done" class="digits number">
              {Number(solver.tilesDone ?? 0).toLocaleString("en")}
            </td>
            <td
              data-label="Failed"
              class={`digits number ${Number(solver.tilesFailed ?? 0) > 0 ? "caution-text" : ""}`}
            >
              {Number(solver.tilesFailed ?? 0).toLocaleString("en")}
            </td>
            <td data-label="Machine">
              <span>
                {solver.host || "–"}
                <span class="note">
                  {" "}
                  {countText(solver.threads ?? 0, "thread")}
                  {solver.vectors && `, ${solver.vectors}`}
                </span>
              </span>
            </td>
            <td data-label="Problem" class={solver.refused ? "caution-text" : ""}>
              <Message text={solver.refused || solver.lastError || "–"} />
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function dueText(deadline: string, lateS: number | string | undefined): string {
  if (lateS === undefined) return `due at ${deadline}`;
  return Number(lateS) > 0 ? `late by ${secondsText(Number(lateS))}` : "in time";
}

function Solve({ solve }: { solve: FleetSolveJson }) {
  const {
    session = "",
    tileCount = 0,
    tilesDone = 0,
    tilesLeased = 0,
    failures = 0,
    quarantined = 0,
    held,
    server,
  } = solve;
  const left = Number(solve.secondsLeft ?? 0);
  return (
    <li class="solve">
      <div class="row">
        {server ? (
          <b>{session}</b>
        ) : (
          <a href={`#/session/${encodeURIComponent(session)}`}>
            <b>{session}</b>
          </a>
        )}
        <State kind={held ? "paused" : "busy"}>
          {held ? "stopped" : tileCount === 0 ? "estimating" : "solving"}
        </State>
        <span class="note">
          {solve.method}
          {server && `, of ${server}`}
        </span>
        <span class="spacer" />
        <span class="digits">
          {tilesDone} of {tileCount || "?"} tiles
        </span>
      </div>
      {tileCount > 0 ? (
        <progress value={tilesDone} max={tileCount} aria-label={`Tiles of ${session} that are done`} />
      ) : (
        <progress aria-label={`${session} is being estimated`} />
      )}
      <span class="note">
        {tilesLeased} in progress
        {Number(solve.tilesPerSecond ?? 0) > 0 && `, ${rateText(solve.tilesPerSecond)} a second`}
        {left > 0 && `, ${secondsText(left)} left`}
        {solve.deadline && `, ${dueText(solve.deadline, solve.lateS)}`}
        {failures > 0 && `, ${failures} failed attempts`}
        {quarantined > 0 && `, ${quarantined} tiles given up`}
      </span>
    </li>
  );
}

export default function Page() {
  const { value, live, error } = useFeed(
    (signal) => polled<GetFleetResponseJson>("FleetService/GetFleet", {}, 1, { signal }),
    [],
  );
  const solvers = value?.solvers ?? [],
    solves = value?.solves ?? [];
  const rate = solvers.reduce((sum, { tilesPerSecond }) => sum + Number(tilesPerSecond ?? 0), 0);
  return (
    <div class={live || !value ? "fleet" : "fleet stale"}>
      <div class="row">
        <h1>Fleet</h1>
        {value && (
          <span class="note">
            {solvers.filter(({ up }) => up).length} of {solvers.length} solvers are up
            {rate > 0 && `, ${rate.toFixed(2)} tiles a second`}; jobs are in {value.store}
          </span>
        )}
      </div>
      {!live && <FeedFailure error={error} />}
      {value && (
        <>
          <section class="card">
            <h2>Solves</h2>
            {solves.length === 0 ? (
              <p class="note">Nothing is being solved.</p>
            ) : (
              <ul class="solves">
                {solves.map((solve) => (
                  <Solve key={`${solve.server} ${solve.session}`} solve={solve} />
                ))}
              </ul>
            )}
          </section>
          <section class="card">
            <h2>Solvers</h2>
            <Solvers solvers={solvers} />
          </section>
        </>
      )}
    </div>
  );
}
