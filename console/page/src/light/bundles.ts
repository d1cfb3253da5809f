// Bundles of directions, as the shader of environments reads them. A file has them as footprints on the faces of a cube of
// half side 1 around the camera (core/rays/cube.h): a face's axis is `face >> 1`, towards + for even faces; its x and y are the
// next two axes.
import { FootprintWords } from "./footprints";
import type { MatteMetadata, Mode } from "./matte";

type Vector = [number, number, number];

/**
 * The covariance is along the horizontal, e1 = (z, 0, -x), and across it, e2 = direction x e1, rad^2, so rotations about the
 * vertical do not change it. Straight up and down e1 is (1, 0, 0).
 */
export interface Bundle {
  direction: Vector;
  xx: number;
  xy: number;
  yy: number;
}

export function bundleOf(mode: Mode, side_px: number): Bundle {
  const unit = 2 / side_px;
  const axis = mode.texture >> 1;
  const [right, down] = [(axis + 1) % 3, (axis + 2) % 3];
  const place: Vector = [0, 0, 0];
  place[axis] = mode.texture % 2 === 0 ? 1 : -1;
  place[right] = unit * mode.x - 1;
  place[down] = unit * mode.y - 1;
  const far = Math.hypot(...place);
  const direction = place.map((each) => each / far) as Vector;
  const [x, y, z] = direction;
  const flat = Math.hypot(x, z);
  const e1: Vector = flat > 1e-6 ? [z / flat, 0, -x / flat] : [1, 0, 0];
  const e2: Vector = [y * e1[2], z * e1[0] - x * e1[2], -y * e1[0]];
  // A step on the face turns the direction by its part across it, over the distance; e1 and e2 lie across.
  const turn = (e: Vector): [number, number] => [(unit / far) * e[right]!, (unit / far) * e[down]!];
  const [a, b] = [turn(e1), turn(e2)];
  const covariance = (p: [number, number], q: [number, number]): number =>
    p[0] * q[0] * mode.xx + (p[0] * q[1] + p[1] * q[0]) * mode.xy + p[1] * q[1] * mode.yy;
  return { direction, xx: covariance(a, a), xy: covariance(a, b), yy: covariance(b, b) };
}

/** The direction, its covariance xx, yy, the weights, and xy. */
export class BundleList extends FootprintWords {
  private readonly side_px: number;
  constructor({ monitors }: MatteMetadata, pixels: number, most: number) {
    super(pixels, most);
    this.side_px = monitors[0]!.width_px;
  }

  override add(mode: Mode, weights: readonly number[]): void {
    const { direction, xx, xy, yy } = bundleOf(mode, this.side_px);
    this.put([...direction, xx, yy], weights, 0, xy);
  }
}

