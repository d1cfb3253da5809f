import type { AdaptedRoundJson } from "../gen/glasswing/v1/session_pb";

/** Of pixels that are known: rounded down. */
export const percent = (share: AdaptedRoundJson["knownShare"]): string => `${Math.floor(100 * Number(share ?? 0))} %`;
export const decibels = (db: AdaptedRoundJson["errorDb"]): string => `${Number(db ?? 0).toFixed(1)} dB`;

/** What was known after the plan's own images and after each round, as `glasswing show` lists it. */
export function Rounds({ rounds }: { rounds: readonly AdaptedRoundJson[] }) {
  if (rounds.length === 0) return null;
  const shapes = rounds.some(({ anyShape }) => anyShape);
  return (
    <details>
      <summary>What each round found</summary>
      <div class="wide" tabIndex={0} role="region" aria-label="What each round found">
        <table>
          <thead>
            <tr>
              <th scope="col">images</th>
              <th scope="col">known well enough</th>
              <th scope="col">95 % to</th>
              {shapes && (
                <>
                  <th scope="col">of any shape</th>
                  <th scope="col">of these known</th>
                  <th scope="col">95 % of these to</th>
                </>
              )}
            </tr>
          </thead>
          <tbody>
            {rounds.map(({ imageCount = 0, knownShare, errorDb, anyShape }) => (
              <tr key={imageCount}>
                <th scope="row">{imageCount.toLocaleString("en")}</th>
                <td>{percent(knownShare)}</td>
                <td>{decibels(errorDb)}</td>
                {shapes && (
                  <>
                    <td>{(100 * Number(anyShape?.share ?? 0)).toFixed(0)} %</td>
                    <td>{anyShape && percent(anyShape.knownShare)}</td>
                    <td>{anyShape && decibels(anyShape.errorDb)}</td>
                  </>
                )}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}
