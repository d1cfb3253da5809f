// Rays that the console makes of two sessions' mattes (console/rays/made_rays.h).
import { ask } from "../api";
import type { RigGeometryJson } from "../gen/glasswing/v1/rays_pb";
import type { Drawable } from "../light/compositor";
import { parsed } from "../parts/json";
import { checkedDescription, readWebMatte, type WebDescription } from "../light/web_matte";
import { kRayStates, rigOf, type RayState, type Rig, type SampledRay } from "./geometry";

/** How many rays, and how much of the object's light they carry: the sum of their weights. */
export interface RayCount {
  rays: number;
  light: number;
}

export interface MadeRays {
  description: WebDescription;
  drawable: Drawable;
  /** Of the nearer depth, and of the farther one. */
  poses: [string, string];
  counts: Record<RayState, RayCount>;
  sampled: SampledRay[];
}

/** A session, and the geometry's pose where it was captured. */
export interface Depth {
  session: string;
  pose: string;
}

export interface RayChoice {
  depths: [Depth, Depth];
  /** The geometry's text. */
  geometry: string;
  /** The object absorbs nothing. */
  lossless: boolean;
}

export function raysPath({ depths: [near, far], lossless }: RayChoice, file = false): string {
  const query = new URLSearchParams({
    near: near.session,
    near_pose: near.pose,
    far: far.session,
    far_pose: far.pose,
  });
  if (lossless && !file) query.set("lossless", "1");
  return `${file ? "/rays.exr" : "/rays"}?${query}`;
}

const post = (path: string, geometry: string, signal?: AbortSignal): Promise<Response> =>
  ask(path, {
    method: "POST",
    headers: { "Content-Type": "text/plain" },
    body: geometry,
    ...(signal ? { signal } : {}),
  });

/** Errors name the line, or the value. */
export async function readGeometry(text: string): Promise<Rig> {
  return rigOf(parsed(await (await post("/geometries", text)).text()) as RigGeometryJson);
}

export async function makeRays(choice: RayChoice, signal: AbortSignal): Promise<MadeRays> {
  const response = await post(raysPath(choice), choice.geometry, signal);
  return readRays(new Uint8Array(await response.arrayBuffer()));
}

export async function rayFile(choice: RayChoice): Promise<Blob> {
  return (await post(raysPath(choice, true), choice.geometry)).blob();
}

type Told = Pick<MadeRays, "description" | "poses" | "counts"> & {
  /** State, weight, origin and direction. */
  sampled: [number, number, number, number, number, number, number, number][];
};

/** One line of JSON, and the planes that its description tells of. */
export async function readRays(bytes: Uint8Array<ArrayBuffer>): Promise<MadeRays> {
  const end = bytes.indexOf(10);
  if (end < 0) throw new Error("the console's rays end too early");
  const { description, poses, counts, sampled } = JSON.parse(new TextDecoder().decode(bytes.subarray(0, end))) as Told;
  const drawable = await readWebMatte(checkedDescription(description), bytes.subarray(end + 1));
  return {
    description,
    drawable,
    poses,
    counts,
    sampled: sampled.map(([state, , ox, oy, oz, dx, dy, dz]) => ({
      state: kRayStates[state] ?? "unknown",
      origin_mm: [ox, oy, oz],
      direction: [dx, dy, dz],
    })),
  };
}
