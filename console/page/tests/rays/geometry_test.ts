import { describe, expect, it } from "vitest";
import { cornersOf, figuresOf, measuredText, placeOn, rigOf, viewAt, type Pose, type Vector } from "../../src/rays/geometry";
import { gapOf, gridStep, linesOfPose, linesOfRays } from "../../src/rays/rig_lines";

/** Turned about the vertical, with its corner at `at`. */
function pose(turn_deg: number, at: Vector, covariance: number[] = []): Pose {
  const [sin, cos] = [Math.sin((turn_deg * Math.PI) / 180), Math.cos((turn_deg * Math.PI) / 180)];
  return {
    name: "near",
    monitor: "",
    width_px: 100,
    height_px: 50,
    pitch_mm: 2,
    rotation: [cos, 0, sin, 0, 1, 0, -sin, 0, cos],
    translation_mm: at,
    covariance,
    residual_px: 0,
  };
}
const expectPlace = (place: Vector, expected: Vector): void =>
  place.forEach((each, i) => expect(each).toBeCloseTo(expected[i]!, 9));

describe("a pose", () => {
  it("has its pixels where they stand", () => {
    expectPlace(placeOn(pose(0, [-100, -50, 300]), 25, 10), [-50, -30, 300]);
    // By a right angle its x axis points to the camera.
    expectPlace(placeOn(pose(90, [10, 0, 300]), 30, 10), [10, 20, 240]);
    expectPlace(cornersOf(pose(90, [0, 0, 300]))[2], [0, 100, 100]);
  });

  it("has a distance and a tilt", () => {
    const { distance, tilt } = figuresOf(pose(30, [0, 0, 300]));
    expect(tilt.value).toBeCloseTo(30, 9);
    // Its middle is 100 mm along its x axis and 50 mm down.
    expect(distance.value).toBeCloseTo(Math.hypot(100 * Math.cos(Math.PI / 6), 50, 300 - 50), 9);
    expect([distance.sd, tilt.sd]).toEqual([undefined, undefined]);
  });

  it("has standard errors as its covariance says: the scatter of poses that are off by it", () => {
    const sd = [1e-4, 2e-4, 3e-4, 0.02, 0.03, 0.04];
    const covariance = Array.from({ length: 36 }, (_, at) => (at % 7 === 0 ? sd[at / 7]! ** 2 : 0));
    const exact = pose(20, [-60, -40, 250], covariance);
    const { distance, tilt } = figuresOf(exact);
    // By finite differences: a small turn w about the camera's axes takes R to R + w x R, about the corner.
    const moved = (k: number): number => {
      const w: Vector = [0, 0, 0];
      const t = [...exact.translation_mm] as Vector;
      const step = 1e-6;
      if (k < 3) w[k] = step;
      else t[k - 3]! += step;
      const column = (c: number): Vector => [0, 1, 2].map((row) => exact.rotation[3 * row + c]!) as Vector;
      const turned = [0, 1, 2].map((c) => {
        const [x, y, z] = column(c);
        return [x + w[1] * z - w[2] * y, y + w[2] * x - w[0] * z, z + w[0] * y - w[1] * x];
      });
      const rotation = [0, 1, 2].flatMap((row) => [0, 1, 2].map((c) => turned[c]![row]!));
      return (figuresOf({ ...exact, rotation, translation_mm: t }).distance.value - distance.value) / step;
    };
    const variance = sd.reduce((sum, each, k) => sum + (each * moved(k)) ** 2, 0);
    expect(distance.sd! / Math.sqrt(variance)).toBeCloseTo(1, 4);
    expect(tilt.sd).toBeCloseTo((180 / Math.PI) * Math.sqrt((1e-8 + 4e-8 + 9e-8) / 3), 9);
  });
});

describe("a geometry's JSON", () => {
  const rig = rigOf({
    camera: { widthPx: 160, heightPx: 120, fxPx: 250, fyPx: 240, cxPx: 80, cyPx: 60, sd: [0.05, 0, 0, 0, 0, 0, 0, 0, 0] },
    monitors: [{ name: "near", widthPx: 10, heightPx: 8, pitchMm: 1, rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translationMm: [0, 0, 200] }],
    warnings: ["few poses"],
  });
  it("has what is left out as 0", () => {
    expect(rig.camera.lens.fx).toEqual({ value: 250, sd: 0.05 });
    expect(rig.camera.lens.k3).toEqual({ value: 0, sd: 0 });
    expect(rig.poses[0]).toMatchObject({ monitor: "", covariance: [], residual_px: 0 });
    expect(rig.warnings).toEqual(["few poses"]);
  });
  it("says what the camera sees", () => {
    const [corner, , opposite] = viewAt(rig.camera, 500);
    expectPlace(corner, [-160, -125, 500]); // 80 px of 250, 60 of 240
    expectPlace(opposite, [160, 125, 500]);
  });
});

describe("lines", () => {
  it("are of few cells", () => {
    expect(gridStep({ width_px: 128, height_px: 96 })).toBe(8);
    expect(gridStep({ width_px: 3840, height_px: 2160 })).toBe(256);
    const { grid, edges, grid_px } = linesOfPose(pose(0, [0, 0, 300]));
    expect(grid_px).toBe(8);
    expect(grid.length).toBe(12 + 6); // 8, 16 … 96 of 100, and 8 … 48 of 50
    expect(edges.length).toBe(4);
  });
  it("of rays reach over both depths", () => {
    const [near, far] = [pose(0, [0, 0, 200]), pose(0, [5, -3, 251.2])];
    expect(gapOf(near, far)).toBeCloseTo(51.2, 9);
    const { matched, unknown } = linesOfRays([{ state: "matched", origin_mm: [1, 2, 200], direction: [0, 0, 1] }], 40);
    expect(unknown).toEqual([]);
    expectPlace(matched[0]![0], [1, 2, 180]);
    expectPlace(matched[0]![1], [1, 2, 250]);
  });
});

describe("numbers", () => {
  it("have two digits of their standard error", () => {
    expect(measuredText({ value: 204.9712, sd: 0.042 }, 1)).toBe("204.971 ± 0.042");
    expect(measuredText({ value: 204.97, sd: 12 }, 1)).toBe("205 ± 12");
    expect(measuredText({ value: 204.97, sd: undefined }, 1)).toBe("205.0");
  });
});
