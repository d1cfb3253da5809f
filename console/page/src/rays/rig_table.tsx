import { figuresOf, kLens, measuredText, type Rig } from "./geometry";

const residual = (px: number): string => (px > 0 ? `${px.toFixed(3)} px` : "unknown");

/** What a geometry says of its poses and its lens, and how well they are known. */
export function RigTable({ rig: { camera, poses, warnings, residual_px } }: { rig: Rig }) {
  return (
    <div class="rig-table">
      {warnings.length > 0 && (
        <ul class="caution-text" aria-label="Weaknesses of the geometry">
          {warnings.map((warning) => (
            <li key={warning}>{warning}</li>
          ))}
        </ul>
      )}
      <table class="stack">
        <thead>
          <tr>
            <th>Pose</th>
            <th>Monitor</th>
            <th class="number">Distance (mm)</th>
            <th class="number">Tilt (°)</th>
            <th class="number">Residual</th>
          </tr>
        </thead>
        <tbody>
          {poses.map((pose, i) => {
            const { distance, tilt } = figuresOf(pose);
            return (
              <tr key={i}>
                <td data-label="Pose">{pose.name}</td>
                <td data-label="Monitor">
                  {pose.monitor} {pose.width_px}×{pose.height_px} px of {Number(pose.pitch_mm.toPrecision(4))} mm
                </td>
                <td data-label="Distance (mm)" class="number digits">
                  {measuredText(distance, 1)}
                </td>
                <td data-label="Tilt (°)" class="number digits">
                  {measuredText(tilt, 1)}
                </td>
                <td data-label="Residual" class="number digits">
                  {residual(pose.residual_px)}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
      <p class="note">
        Camera {camera.width_px}×{camera.height_px} px{residual_px > 0 && `, points are off by ${residual(residual_px)} (rms)`}.{" "}
        {kLens.map((name, i) => (
          <span key={name} class="lens">
            {name} {measuredText(camera.lens[name], i < 4 ? 2 : 4)}
            {i < 4 ? " px" : ""}
          </span>
        ))}
      </p>
    </div>
  );
}
