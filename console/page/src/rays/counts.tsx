import { kRayStates, type RayState } from "./geometry";
import type { RayCount } from "./made_rays";

const kMeanings: Record<RayState, string> = {
  matched: "through a place that was measured at either depth",
  ambiguous: "the same, but another match is about as likely",
  extrapolated: "seen at one depth, direction from its neighbours: an estimate with a standard error",
  unknown: "seen at one depth, direction unknown",
};

/** How much of the object's light came along rays of each state. */
export function Counts({ counts }: { counts: Record<RayState, RayCount> }) {
  const all = Math.max(1e-12, kRayStates.reduce((sum, state) => sum + counts[state].light, 0));
  return (
    <table class="stack">
      <thead>
        <tr>
          <th>State</th>
          <th class="number">Rays</th>
          <th class="number">Light</th>
          <th>What it means</th>
        </tr>
      </thead>
      <tbody>
        {kRayStates.map((state) => (
          <tr key={state} class={`ray-${state}`}>
            <td data-label="State">
              <span class="ray-name">{state}</span>
            </td>
            <td data-label="Rays" class="number digits">
              {counts[state].rays.toLocaleString("en")}
            </td>
            <td data-label="Light" class="number digits">
              {((100 * counts[state].light) / all).toFixed(1)} %
            </td>
            <td data-label="Means">{kMeanings[state]}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
