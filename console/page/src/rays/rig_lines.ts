// The lines of a rig in space.
import { along, type Orbit } from "./orbit";
import { cornersOf, figuresOf, placeOn, viewAt, type Pose, type RayState, type Rig, type SampledRay, type Vector } from "./geometry";

export type Line = [Vector, Vector];

export interface PoseLines {
  label: string;
  /** Of the label: the monitor's top left corner. */
  corner: Vector;
  edges: Line[];
  /** Between every so many of its pixels. */
  grid: Line[];
  grid_px: number;
}

const kMaxCells = 16;
const kFrustum = 0.35; // of the nearest monitor's distance
const kOrigin: Vector = [0, 0, 0];

const closed = (corners: Vector[]): Line[] => corners.map((corner, i) => [corner, corners[(i + 1) % corners.length]!]);

/** A power of two with at most kMaxCells cells along the longer side. */
export function gridStep({ width_px, height_px }: { width_px: number; height_px: number }): number {
  let step = 1;
  while (Math.max(width_px, height_px) > kMaxCells * step) step *= 2;
  return step;
}

export function linesOfPose(pose: Pose): PoseLines {
  const { width_px: w, height_px: h } = pose;
  const step = gridStep(pose);
  const grid: Line[] = [];
  for (let x = step; x < w; x += step) grid.push([placeOn(pose, x, 0), placeOn(pose, x, h)]);
  for (let y = step; y < h; y += step) grid.push([placeOn(pose, 0, y), placeOn(pose, w, y)]);
  const corners = cornersOf(pose);
  const label = pose.monitor === "" ? pose.name : `${pose.name} (${pose.monitor})`;
  return { label, corner: corners[0], edges: closed(corners), grid, grid_px: step };
}

/** What the camera sees, from its centre of projection on. */
export function frustumOf(rig: Rig): Line[] {
  const nearest = Math.min(...rig.poses.map((pose) => figuresOf(pose).distance.value));
  const end = viewAt(rig.camera, kFrustum * nearest);
  return [...end.map((corner): Line => [kOrigin, corner]), ...closed(end)];
}

/** How far two poses are apart, along the nearer one's normal; of the monitors that both have the nearest. */
export function gapOf(near: Pose, far: Pose): number {
  const [, , r2, , , r5, , , r8] = near.rotation;
  const between = along(far.translation_mm, near.translation_mm, -1);
  return Math.abs(between[0] * r2! + between[1] * r5! + between[2] * r8!);
}

/** From half a gap before the nearer monitor to a quarter beyond the farther one. */
export function linesOfRays(rays: SampledRay[], gap_mm: number): Record<RayState, Line[]> {
  const lines: Record<RayState, Line[]> = { matched: [], ambiguous: [], extrapolated: [], unknown: [] };
  for (const { state, origin_mm, direction } of rays)
    lines[state].push([along(origin_mm, direction, -0.5 * gap_mm), along(origin_mm, direction, 1.25 * gap_mm)]);
  return lines;
}

/** Of all that is drawn but rays. */
export function placesOf(rig: Rig): Vector[] {
  return [kOrigin, ...rig.poses.flatMap(cornersOf)];
}

/** As the camera sees: from its place. */
export function fromCamera(rig: Rig): Orbit {
  const nearest = Math.min(...rig.poses.map((pose) => figuresOf(pose).distance.value));
  return { yaw_deg: 0, pitch_deg: 0, distance_mm: nearest, target_mm: [0, 0, nearest] };
}
