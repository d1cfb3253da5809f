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

/** The value of 16 bits. */
export function fromHalf(bits: number): number {
  const [exponent, mantissa] = [(bits >> 10) & 31, bits & 1023];
  const size =
    exponent === 31
      ? mantissa === 0
        ? Infinity
        : NaN
      : exponent === 0
        ? mantissa * 2 ** -24
        : (1 + mantissa / 1024) * 2 ** (exponent - 15);
  return bits & 0x8000 ? -size : size;
}
