import { useEffect, useRef, useState } from "preact/hooks";
import { call } from "../api";
import type {
  CameraCalibrationJson,
  DisplayCalibrationJson,
  MonitorSyncJson,
} from "../gen/glasswing/v1/calibration_pb";
import type { ListCalibrationsResponseJson } from "../gen/glasswing/v1/rig_service_pb";
import { Failure } from "../parts/failure";
import { Calibrate } from "./calibrate";
import { CurveCharts, type Curves } from "./curves";
import { nanosecondsText, timeText } from "../parts/words";
import { kLookAgain_s } from "./running_fit";

interface Row {
  device: string;
  what: string;
  found: string;
  measured: string;
  warnings: readonly string[];
}

function cameraRow({
  camera = "",
  linear,
  widthPx,
  heightPx,
  bits,
  whiteMs,
  measured = "",
  warnings = [],
}: CameraCalibrationJson): Row {
  const white = Number(whiteMs ?? 0);
  const found = `${linear ? "linear" : "not linear"}, ${bits ?? "?"} bits, ${widthPx}×${heightPx}${white > 0 ? `; white reaches full scale at ${white.toFixed(1)} ms` : ""}`;
  return { device: camera, what: "camera response", found, measured, warnings };
}

function displayRow({
  monitor = "",
  primaries = [],
  bits,
  drift,
  measured = "",
  warnings = [],
}: DisplayCalibrationJson): Row {
  const gammas = primaries.map(({ gamma }) => Number(gamma ?? 0).toFixed(2)).join(", ");
  return {
    device: monitor,
    what: "monitor response",
    found: `gamma ${gammas}; ${bits ?? "?"} bits; drift ${(100 * Number(drift ?? 0)).toFixed(1)} %`,
    measured,
    warnings,
  };
}

function syncRow({ monitor = "", lagNs, settleNs, errorNs, measured = "" }: MonitorSyncJson): Row {
  const found = `light ${nanosecondsText(Number(lagNs ?? 0))} late, settled after ${nanosecondsText(Number(settleNs ?? 0))} (± ${nanosecondsText(Number(errorNs ?? 0))})`;
  return { device: monitor, what: "monitor timing", found, measured, warnings: [] };
}

function curvesOf({ cameras = [], displays = [] }: ListCalibrationsResponseJson): Curves[] {
  return [
    ...cameras.map(({ camera = "", curves = [] }) => ({
      device: camera,
      lines: curves.map(({ light = [] }) => light.map(Number)),
    })),
    ...displays.map(({ monitor = "", primaries = [] }) => ({
      device: monitor,
      lines: primaries.map(({ radiance = [] }) => radiance.map(Number)),
    })),
  ];
}

export function Calibrations() {
  const [known, setKnown] = useState<ListCalibrationsResponseJson>();
  const [error, setError] = useState<unknown>();
  const again = useRef<ReturnType<typeof setTimeout> | undefined>(undefined);
  const look = (): void => {
    clearTimeout(again.current);
    call<ListCalibrationsResponseJson>("RigService/ListCalibrations").then((now) => {
      setKnown(now);
      if (now.fits) again.current = setTimeout(look, 1000 * kLookAgain_s);
    }, setError);
  };
  useEffect(() => (look(), () => clearTimeout(again.current)), []);
  const rows = known && [
    ...(known.cameras ?? []).map(cameraRow),
    ...(known.displays ?? []).map(displayRow),
    ...(known.sync?.monitors ?? []).map(syncRow),
  ];
  return (
    <section class="card">
      <h2>In force</h2>
      <Calibrate done={look} />
      {error !== undefined && <Failure error={error} />}
      {known?.fits?.map(({ session = "", since = "" }) => (
        <p key={session} role="status">
          A calibration is being fitted to <a href={`#/session/${encodeURIComponent(session)}`}>{session}</a>{" "}
          since {timeText(since)}. It may take some minutes, also without this page.
        </p>
      ))}
      {rows?.length === 0 && (
        <p class="note">
          Nothing is calibrated yet: monitors and cameras are assumed to be linear, with their declared timing.
        </p>
      )}
      {rows && rows.length > 0 && (
        <table class="stack">
          <thead>
            <tr>
              <th>Device</th>
              <th>Of</th>
              <th>Result</th>
              <th>Measured</th>
            </tr>
          </thead>
          <tbody>
            {rows.map(({ device, what, found, measured, warnings }) => (
              <tr key={device + what}>
                <td data-label="Device">
                  <b>{device}</b>
                </td>
                <td data-label="Of">{what}</td>
                <td data-label="Result">
                  {found}
                  {warnings.map((text) => (
                    <span key={text} class="advice">
                      {text}
                    </span>
                  ))}
                </td>
                <td data-label="Measured">{timeText(measured)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {known && <CurveCharts curves={curvesOf(known)} />}
    </section>
  );
}
