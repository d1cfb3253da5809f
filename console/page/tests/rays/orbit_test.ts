import { describe, expect, it } from "vitest";
import type { Vector } from "../../src/rays/geometry";
import { axesOf, byKey, dot, orbitAround, turnedBy, View, zoomedBy, type Orbit } from "../../src/rays/orbit";

const kSize = 400;
const kFocal = 200 / Math.tan((20 * Math.PI) / 180); // 40 degrees across

const orbit = (yaw_deg: number, pitch_deg: number, target_mm: Vector = [0, 0, 300]): Orbit => ({
  yaw_deg,
  pitch_deg,
  distance_mm: 300,
  target_mm,
});
const expectPoint = (seen: readonly [number, number] | undefined, x: number, y: number): void => {
  expect(seen![0]).toBeCloseTo(x, 6);
  expect(seen![1]).toBeCloseTo(y, 6);
};

describe("the viewer", () => {
  it("is a pinhole where the camera is", () => {
    const view = new View(orbit(0, 0), kSize, kSize);
    expectPoint(view.point([0, 0, 300]), 200, 200);
    expectPoint(view.point([30, -60, 600]), 200 + (kFocal * 30) / 600, 200 - (kFocal * 60) / 600);
  });
  it("sees what is far on the right of what is near from the camera's right", () => {
    const view = new View(orbit(90, 0), kSize, kSize); // at (300, 0, 300)
    expectPoint(view.point([0, 0, 400]), 200 + (kFocal * 100) / 300, 200);
    expectPoint(view.point([100, 20, 300]), 200, 200 + (kFocal * 20) / 200);
  });
  it("sees what is far above what is near from above", () => {
    const view = new View(orbit(0, 89), kSize, kSize);
    expect(view.point([0, 0, 350])![1]).toBeLessThan(view.point([0, 0, 250])![1]);
  });
  it("has axes at right angles, and what it circles around in the middle", () => {
    for (const yaw of [-170, -30, 0, 45, 120])
      for (const pitch of [-80, 0, 33, 89]) {
        const { right, down, forward } = axesOf(orbit(yaw, pitch));
        for (const [a, b] of [[right, down], [down, forward], [forward, right]] as const) expect(dot(a, b)).toBeCloseTo(0, 12);
        for (const axis of [right, down, forward]) expect(dot(axis, axis)).toBeCloseTo(1, 12);
        expectPoint(new View(orbit(yaw, pitch, [7, -9, 150]), 640, 360).point([7, -9, 150]), 320, 180);
      }
  });
  it("draws of a line what is before it", () => {
    const view = new View(orbit(0, 0), kSize, kSize); // nearest: 6 mm
    const [from, to] = view.line([1, 0, -100], [1, 0, 300])!;
    expectPoint(from, 200 + kFocal / 6, 200);
    expectPoint(to, 200 + kFocal / 300, 200);
    expectPoint(view.line([1, 0, 300], [1, 0, -100])![1], 200 + kFocal / 6, 200);
    expect(view.line([1, 0, -100], [1, 0, -5])).toBeUndefined();
    expect(view.point([0, 0, -5])).toBeUndefined();
  });
  it("shows all places", () => {
    const places: Vector[] = [[0, 0, 0], [-64, -48, 200], [200, 48, 251]];
    for (const [width, height] of [[400, 300], [300, 700]] as const)
      for (const yaw of [0, 62, 200]) {
        const view = new View(orbitAround(places, yaw, 20), width, height);
        for (const place of places) {
          const [x, y] = view.point(place)!;
          expect(x).toBeGreaterThanOrEqual(0);
          expect(x).toBeLessThanOrEqual(width);
          expect(y).toBeGreaterThanOrEqual(0);
          expect(y).toBeLessThanOrEqual(height);
        }
      }
  });
});

describe("keys", () => {
  const first = orbit(10, 20);
  const key = (name: string, from = first) => byKey({ key: name, shiftKey: false }, from, first);
  it("turn and scale it", () => {
    expect(key("ArrowRight")).toMatchObject({ yaw_deg: 15, pitch_deg: 20 });
    expect(key("ArrowUp")).toMatchObject({ yaw_deg: 10, pitch_deg: 25 });
    expect(key("+")!.distance_mm).toBeCloseTo(300 / 1.15);
    expect(key("0", orbit(77, 3))).toEqual(first);
    expect(key("a")).toBeUndefined();
  });
  it("never turn it over, or lose it", () => {
    expect(turnedBy(first, 0, 500).pitch_deg).toBe(89);
    expect(zoomedBy(first, 1e9, first).distance_mm).toBeCloseTo(15);
    expect(zoomedBy(first, 1e-9, first).distance_mm).toBeCloseTo(6000);
  });
});
