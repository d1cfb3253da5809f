// A pixel's samples of a sweep, and those predicted by the matte's modes. A stripe at r with normal n,
//
//   T(x) = peak exp(-(n.x - r)^2 / (2 s^2)),   n = (cos phi, sin phi)
//
// seen through a Gaussian (c, S) of weight R gives R peak s / q exp(-(n.c - r)^2 / (2 q^2)), q^2 = s^2 + n^T S n, neglecting
// what lies beyond the monitor's edge.
import type { CaptureManifestJson, FrameJson } from "../gen/glasswing/v1/archive_pb";
import type { StimulusJson } from "../gen/glasswing/v1/stimulus_pb";
import type { Mode } from "../light/matte";

/** All stripes of one direction on one monitor, with one exposure. */
export interface Sweep {
  title: string;
  texture: number;
  /** One of its stimuli, for what they have in common. */
  stripe: StimulusJson;
  points: { r: number; radiance: (number | null)[] }[];
}

export interface Sample {
  file: string;
  radiance: (number | null)[]; // null: not measured by the photosite
}

export function foretold(
  modes: Mode[],
  foreground: number,
  stripe: StimulusJson,
  texture: number,
  r: number,
  channel: number,
): number {
  const phi = (Number(stripe.phiDeg ?? 0) * Math.PI) / 180;
  const [nx, ny] = [Math.cos(phi), Math.sin(phi)];
  const sigma = Number(stripe.sigmaPx ?? 0);
  const peak = Number(stripe.peak ?? 0) * Number(stripe.colour?.[channel] ?? 1);
  let light = foreground;
  for (const mode of modes) {
    if (mode.texture !== texture) continue;
    const q2 = sigma * sigma + nx * nx * mode.xx + 2 * nx * ny * mode.xy + ny * ny * mode.yy;
    const away = nx * mode.x + ny * mode.y - r;
    light += ((mode.weight * peak * sigma) / Math.sqrt(q2)) * Math.exp((-0.5 * away * away) / q2);
  }
  return light;
}

function isStripe({ object, stimulus, alsoLit }: FrameJson): boolean {
  return object === true && stimulus?.kind === "gauss_stripe" && (alsoLit?.length ?? 0) === 0;
}

export function sweepsOf(manifest: CaptureManifestJson, samples: Sample[]): Sweep[] {
  const byFile = new Map(samples.map(({ file, radiance }) => [file, radiance]));
  const names = (manifest.monitors ?? []).map(({ name }) => name);
  const exposures = new Set((manifest.frames ?? []).map(({ exposureMs }) => exposureMs));
  const sweeps = new Map<string, Sweep>();
  for (const frame of manifest.frames ?? []) {
    const radiance = byFile.get(frame.file ?? "");
    if (!isStripe(frame) || !radiance) continue;
    const stripe = frame.stimulus!;
    const exposure = exposures.size > 1 ? `, ${frame.exposureMs} ms` : "";
    const title = `${stripe.panel ?? ""} at ${stripe.phiDeg ?? 0}°${exposure}`;
    let sweep = sweeps.get(title);
    if (!sweep)
      sweeps.set(title, (sweep = { title, texture: names.indexOf(stripe.panel ?? ""), stripe, points: [] }));
    sweep.points.push({ r: Number(stripe.rPx ?? 0), radiance });
  }
  for (const { points } of sweeps.values()) points.sort((a, b) => a.r - b.r);
  return [...sweeps.values()];
}
