const kFloat = new Float32Array(1);
const kBits = new Uint32Array(kFloat.buffer);
const kLargest = 65504;

/** The bits of the nearest 16-bit float; the number must not be negative and is clamped to the maximum. */
export function toHalf(value: number): number {
  kFloat[0] = Math.min(value, kLargest);
  const bits = kBits[0]!;
  const exponent = (bits >>> 23) - 127;
  if (exponent < -14) return Math.round(value * 2 ** 24);
  const rounded = bits + 0xfff + ((bits >>> 13) & 1);
  return (rounded >>> 13) - ((127 - 15) << 10);
}
