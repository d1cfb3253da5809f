// Converts between the primaries of monitors and the camera's channels (core/radiometry/primary_mix.h): backgrounds are
// multiplied by their monitor's N, and the composite by the inverse of the mean of the known N.
import { NotAMatte } from "./exr";
import type { MatteMetadata } from "./matte";

/** 3 x 3, row by row. */
export type Matrix = [number, number, number, number, number, number, number, number, number];

export const kUnit: Matrix = [1, 0, 0, 0, 1, 0, 0, 0, 1];

export interface PrimaryMix {
  /** For each monitor: its primaries as the channels see them. */
  seen: Matrix[];
  primaries: Matrix;
}

function normalised(share: number[], monitor: string): Matrix {
  const rows = [0, 3, 6].map((at) => share.slice(at, at + 3));
  const sums = rows.map((row) => row.reduce((sum, each) => sum + each, 0));
  if (share.length !== 9 || !sums.every((sum) => Number.isFinite(sum) && sum > 0))
    throw new NotAMatte(
      `its crosstalk of monitor "${monitor}" must be nine numbers in rows of a sum above 0`,
    );
  return rows.flatMap((row, i) => row.map((each) => each / sums[i]!)) as Matrix;
}

export function inverse(m: Matrix): Matrix {
  const [a, b, c, d, e, f, g, h, i] = m;
  const cofactors: Matrix = [
    e * i - f * h,
    c * h - b * i,
    b * f - c * e,
    f * g - d * i,
    a * i - c * g,
    c * d - a * f,
    d * h - e * g,
    b * g - a * h,
    a * e - b * d,
  ];
  const determinant = a * cofactors[0] + b * cofactors[3] + c * cofactors[6];
  return cofactors.map((each) => each / determinant) as Matrix;
}

export function primaryMix({ monitors, crosstalk = [] }: MatteMetadata): PrimaryMix {
  const known: Matrix[] = [];
  const seen = monitors.map(({ name }, t) => {
    const share = crosstalk[t]?.share ?? [];
    if (share.length === 0) return kUnit;
    const matrix = normalised(share, name);
    known.push(matrix);
    return matrix;
  });
  if (known.length === 0) return { seen, primaries: kUnit };
  const mean = kUnit.map(
    (_, i) => known.reduce((sum, matrix) => sum + matrix[i]!, 0) / known.length,
  ) as Matrix;
  return { seen, primaries: inverse(mean) };
}
