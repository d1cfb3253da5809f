// A viewer that circles around a place, and where it sees lines. Places are mm: x right, y down, z forward.
import type { Vector } from "./geometry";

export interface Orbit {
  /** About the vertical; 0: behind the camera, looking as it does; 90: to its right. */
  yaw_deg: number;
  /** Above the place, to 90. */
  pitch_deg: number;
  distance_mm: number;
  target_mm: Vector;
}

const kView_deg = 40;
const kFilled = 0.9; // of it, at most, at first
const kMaxPitch_deg = 89;
const kNearest = 0.02; // of the distance: what is nearer to the eye is not drawn
const kStep_deg = 5;
const kZoom = 1.15;
const [kMinZoom, kMaxZoom] = [0.05, 20];

export function dot([ax, ay, az]: Vector, [bx, by, bz]: Vector): number {
  return ax * bx + ay * by + az * bz;
}
export function along(from: Vector, direction: Vector, length: number): Vector {
  return from.map((each, i) => each + length * direction[i]!) as Vector;
}

export interface Axes {
  right: Vector;
  down: Vector;
  forward: Vector;
  eye_mm: Vector;
}

export function axesOf({ yaw_deg, pitch_deg, distance_mm, target_mm }: Orbit): Axes {
  const [yaw, pitch] = [(yaw_deg * Math.PI) / 180, (pitch_deg * Math.PI) / 180];
  const [sin, cos, up, flat] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
  const forward: Vector = [-sin * flat, up, cos * flat];
  return {
    forward,
    right: [cos, 0, sin],
    down: [sin * up, flat, -cos * up], // forward x right
    eye_mm: along(target_mm, forward, -distance_mm),
  };
}

export type Point = [number, number];

/** Draws on a picture of this size, px. */
export class View {
  private readonly axes: Axes;
  private readonly focal_px: number;
  private readonly nearest_mm: number;

  constructor(
    orbit: Orbit,
    private readonly width_px: number,
    private readonly height_px: number,
  ) {
    this.axes = axesOf(orbit);
    this.focal_px = (0.5 * Math.min(width_px, height_px)) / Math.tan((kView_deg * Math.PI) / 360);
    this.nearest_mm = kNearest * orbit.distance_mm;
  }

  /** Undefined: behind the eye, or too near. */
  point(place: Vector): Point | undefined {
    const seen = this.seen(place);
    return seen[2] < this.nearest_mm ? undefined : this.onPicture(seen);
  }

  /** The part of a line that is before the eye. */
  line(from: Vector, to: Vector): [Point, Point] | undefined {
    let [a, b] = [this.seen(from), this.seen(to)];
    if (Math.max(a[2], b[2]) < this.nearest_mm) return undefined;
    const cut = (near: Vector, far: Vector): Vector => {
      const share = (this.nearest_mm - near[2]) / (far[2] - near[2]);
      return near.map((each, i) => each + share * (far[i]! - each)) as Vector;
    };
    if (a[2] < this.nearest_mm) a = cut(a, b);
    else if (b[2] < this.nearest_mm) b = cut(b, a);
    return [this.onPicture(a), this.onPicture(b)];
  }

  /** To the right, down, and ahead of the eye. */
  private seen(place: Vector): Vector {
    const from = along(place, this.axes.eye_mm, -1);
    return [dot(from, this.axes.right), dot(from, this.axes.down), dot(from, this.axes.forward)];
  }
  private onPicture([x, y, z]: Vector): Point {
    return [0.5 * this.width_px + (this.focal_px * x) / z, 0.5 * this.height_px + (this.focal_px * y) / z];
  }
}

/** Shows all places, from this side, on a square picture or the middle of a longer one. */
export function orbitAround(places: Vector[], yaw_deg: number, pitch_deg: number): Orbit {
  const sides = [0, 1, 2].map((i) => places.map((place) => place[i]!));
  const target_mm = sides.map((side) => 0.5 * (Math.min(...side) + Math.max(...side))) as Vector;
  const { right, down, forward } = axesOf({ yaw_deg, pitch_deg, distance_mm: 1, target_mm });
  // A place is within the picture if the eye is farther from it, along its axis, than it is from that axis by this much.
  const reach = 1 / Math.tan((kFilled * kView_deg * Math.PI) / 360);
  const needed = places.map((place) => {
    const from = along(place, target_mm, -1);
    return reach * Math.max(Math.abs(dot(from, right)), Math.abs(dot(from, down))) - dot(from, forward);
  });
  return { yaw_deg, pitch_deg, distance_mm: Math.max(1, ...needed), target_mm };
}

export function turnedBy(orbit: Orbit, yaw_deg: number, pitch_deg: number): Orbit {
  const pitch = Math.min(kMaxPitch_deg, Math.max(-kMaxPitch_deg, orbit.pitch_deg + pitch_deg));
  return { ...orbit, yaw_deg: orbit.yaw_deg + yaw_deg, pitch_deg: pitch };
}

/** `first`: how far it may be zoomed refers to it. */
export function zoomedBy(orbit: Orbit, factor: number, first: Orbit): Orbit {
  const least = first.distance_mm / kMaxZoom;
  const most = first.distance_mm / kMinZoom;
  return { ...orbit, distance_mm: Math.min(most, Math.max(least, orbit.distance_mm / factor)) };
}

export function byKey(event: { key: string; shiftKey: boolean }, orbit: Orbit, first: Orbit): Orbit | undefined {
  const step = event.shiftKey ? 3 * kStep_deg : kStep_deg;
  switch (event.key) {
    case "ArrowLeft":
      return turnedBy(orbit, -step, 0);
    case "ArrowRight":
      return turnedBy(orbit, step, 0);
    case "ArrowUp":
      return turnedBy(orbit, 0, step);
    case "ArrowDown":
      return turnedBy(orbit, 0, -step);
    case "+":
    case "=":
      return zoomedBy(orbit, kZoom, first);
    case "-":
      return zoomedBy(orbit, 1 / kZoom, first);
    case "0":
      return first;
    default:
      return undefined;
  }
}
