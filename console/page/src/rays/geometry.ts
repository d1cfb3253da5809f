// Where camera and monitors stand (proto/glasswing/v1/rays.proto), as the page shows it. Lengths are mm, in the camera's frame:
// x right, y down, z forward.
import type { CameraGeometryJson, MonitorPoseJson, RigGeometryJson } from "../gen/glasswing/v1/rays_pb";

export type Vector = [number, number, number];

export interface Pose {
  name: string;
  /** Empty: any. */
  monitor: string;
  width_px: number;
  height_px: number;
  /** Of a pixel. */
  pitch_mm: number;
  /** R, row by row: X = R (x pitch, y pitch, 0) + t. */
  rotation: number[];
  translation_mm: Vector;
  /** 6x6, row by row: turn about the camera's axes (rad), translation; empty: unknown. */
  covariance: number[];
  /** rms, camera px; 0: unknown. */
  residual_px: number;
}

/** A number with its standard error; undefined: unknown. */
export interface Measured {
  value: number;
  sd: number | undefined;
}

export interface Camera {
  width_px: number;
  height_px: number;
  /** fx, fy, cx, cy (px), k1, k2, p1, p2, k3. */
  lens: Record<(typeof kLens)[number], Measured>;
}

export interface Rig {
  camera: Camera;
  poses: Pose[];
  warnings: string[];
  /** rms of what it was fitted to, camera px; 0: unknown. */
  residual_px: number;
}

export const kLens = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"] as const;

function cameraOf(json: CameraGeometryJson): Camera {
  const values = [json.fxPx, json.fyPx, json.cxPx, json.cyPx, json.k1, json.k2, json.p1, json.p2, json.k3];
  const lens = Object.fromEntries(
    kLens.map((name, i) => [name, { value: Number(values[i] ?? 0), sd: json.sd?.length ? Number(json.sd[i]) : undefined }]),
  ) as Camera["lens"];
  return { width_px: json.widthPx ?? 0, height_px: json.heightPx ?? 0, lens };
}

function poseOf(json: MonitorPoseJson): Pose {
  return {
    name: json.name ?? "",
    monitor: json.monitor ?? "",
    width_px: json.widthPx ?? 0,
    height_px: json.heightPx ?? 0,
    pitch_mm: Number(json.pitchMm ?? 0),
    rotation: (json.rotation ?? []).map(Number),
    translation_mm: (json.translationMm ?? []).map(Number) as Vector,
    covariance: (json.covariance ?? []).map(Number),
    residual_px: Number(json.residualPx ?? 0),
  };
}

export function rigOf({ camera = {}, monitors = [], warnings = [], residualPx = 0 }: RigGeometryJson): Rig {
  return { camera: cameraOf(camera), poses: monitors.map(poseOf), warnings, residual_px: Number(residualPx) };
}

/** From the monitor's corner, along its own axes (mm). */
function turned({ rotation: r }: Pose, x: number, y: number): Vector {
  return [r[0]! * x + r[1]! * y, r[3]! * x + r[4]! * y, r[6]! * x + r[7]! * y];
}

/** Of pixel coordinates, whose origin is the outer corner of the top left pixel. */
export function placeOn(pose: Pose, x_px: number, y_px: number): Vector {
  const from = turned(pose, pose.pitch_mm * x_px, pose.pitch_mm * y_px);
  return from.map((each, i) => each + pose.translation_mm[i]!) as Vector;
}

/** Outer corners, from the top left one on, clockwise as one looks at the picture. */
export function cornersOf(pose: Pose): [Vector, Vector, Vector, Vector] {
  const { width_px: w, height_px: h } = pose;
  return [placeOn(pose, 0, 0), placeOn(pose, w, 0), placeOn(pose, w, h), placeOn(pose, 0, h)];
}

/** Where the camera's picture ends, at a depth; from its top left corner on. Without the lens's distortion. */
export function viewAt({ width_px, height_px, lens }: Camera, depth_mm: number): [Vector, Vector, Vector, Vector] {
  const at = (x: number, y: number): Vector => [
    (depth_mm * (x - lens.cx.value)) / lens.fx.value,
    (depth_mm * (y - lens.cy.value)) / lens.fy.value,
    depth_mm,
  ];
  return [at(0, 0), at(width_px, 0), at(width_px, height_px), at(0, height_px)];
}

export interface PoseFigures {
  /** Of the monitor's middle from the camera, mm. */
  distance: Measured;
  /** Of the monitor's normal to the camera's axis, degrees. */
  tilt: Measured;
}

/** As `glasswing calibrate geometry` prints them. */
export function figuresOf(pose: Pose): PoseFigures {
  const from = turned(pose, 0.5 * pose.pitch_mm * pose.width_px, 0.5 * pose.pitch_mm * pose.height_px);
  const middle = from.map((each, i) => each + pose.translation_mm[i]!) as Vector;
  const distance = Math.hypot(...middle);
  const [ux, uy, uz] = middle.map((each) => each / distance) as Vector;
  const known = pose.covariance.length === 36;
  // A small turn w moves the middle by w x from, along the unit u by w . (from x u).
  const [fx, fy, fz] = from;
  const by = [fy * uz - fz * uy, fz * ux - fx * uz, fx * uy - fy * ux, ux, uy, uz];
  let variance = 0;
  for (let i = 0; i < 6; ++i) for (let k = 0; k < 6; ++k) variance += by[i]! * by[k]! * (pose.covariance[6 * i + k] ?? 0);
  const turn = [0, 7, 14].reduce((sum, at) => sum + (pose.covariance[at] ?? 0), 0) / 3;
  const degrees = 180 / Math.PI;
  return {
    distance: { value: distance, sd: known ? Math.sqrt(variance) : undefined },
    tilt: {
      value: degrees * Math.acos(Math.min(1, Math.max(-1, pose.rotation[8]!))),
      sd: known ? degrees * Math.sqrt(turn) : undefined,
    },
  };
}

/** "200.4 ± 0.05", with as many digits as the standard error allows, `digits` where it is unknown. */
export function measuredText({ value, sd }: Measured, digits: number): string {
  if (sd === undefined || !(sd > 0)) return value.toFixed(digits);
  const places = Math.min(5, Math.max(0, 1 - Math.floor(Math.log10(sd))));
  return `${value.toFixed(places)} ± ${sd.toFixed(places)}`;
}

export const kRayStates = ["matched", "ambiguous", "extrapolated", "unknown"] as const;
export type RayState = (typeof kRayStates)[number];

/** A sample of what a pixel saw; its origin lies on the nearer monitor, its direction leads away from the object. */
export interface SampledRay {
  state: RayState;
  origin_mm: Vector;
  direction: Vector;
}
