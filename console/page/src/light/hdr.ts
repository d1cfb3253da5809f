// Reads Radiance's .hdr: light of four bytes a pixel, of which the last is the exponent of the three others.
//
//   light = code * 2^(exponent - 136)

export interface Hdr {
  width: number;
  height: number;
  /** Red, green, blue, exponent of each pixel, row by row from above. */
  codes: Uint8Array<ArrayBuffer>;
}

export class NotHdr extends Error {
  constructor(what: string) {
    super(`the file is damaged or not a Radiance picture: ${what}`);
  }
}

const kMaxPixels = 1 << 26;
const [kMinExponent, kMaxExponent] = [-127, 127];

/** Puts the nearest code of some light at a pixel. Light below 0 is 0, and so is NaN. */
export function putLight(codes: Uint8Array, pixel: number, red: number, green: number, blue: number): void {
  const most = Math.max(red > 0 ? red : 0, green > 0 ? green : 0, blue > 0 ? blue : 0);
  if (most < 2 ** (kMinExponent - 9)) return void codes.fill(0, 4 * pixel, 4 * pixel + 4);
  let exponent = Math.max(kMinExponent, Math.min(kMaxExponent, Math.floor(Math.log2(most)) + 1));
  // The largest rounds up to 256 sometimes.
  if (exponent < kMaxExponent && Math.round(most * 2 ** (8 - exponent)) > 255) ++exponent;
  const code = (light: number): number => (light > 0 ? Math.min(255, Math.round(light * 2 ** (8 - exponent))) : 0);
  codes[4 * pixel] = code(red);
  codes[4 * pixel + 1] = code(green);
  codes[4 * pixel + 2] = code(blue);
  codes[4 * pixel + 3] = exponent + 128;
}
const kMinRun_px = 8;
const kMaxRun_px = 0x7fff;

export function isHdr(bytes: Uint8Array): boolean {
  return bytes[0] === 0x23 && bytes[1] === 0x3f; // "#?"
}

/** Its header ends with an empty line and the size. */
function readHeader(bytes: Uint8Array): { width: number; height: number; at: number } {
  let at = 0;
  const line = (): string => {
    const end = bytes.indexOf(10, at);
    if (end < 0 || end - at > 1000) throw new NotHdr("a line of its header is not terminated");
    const text = new TextDecoder("latin1").decode(bytes.subarray(at, end));
    at = end + 1;
    return text.trim();
  };
  if (!isHdr(bytes)) throw new NotHdr('it does not begin with "#?"');
  for (let text = line(); text !== ""; text = line())
    if (text.startsWith("FORMAT=") && text !== "FORMAT=32-bit_rle_rgbe")
      throw new NotHdr(`its format is ${text.slice(7)}; it must be 32-bit_rle_rgbe`);
  const size = line();
  const [, height, width] = (/^-Y (\d+) \+X (\d+)$/.exec(size) ?? []).map(Number);
  if (!(width && height && width * height <= kMaxPixels))
    throw new NotHdr(`its size is "${size}"; it must be -Y HEIGHT +X WIDTH of up to ${kMaxPixels} pixels`);
  return { width, height, at };
}

export function readHdr(bytes: Uint8Array): Hdr {
  const { width, height, at: start } = readHeader(bytes);
  const codes = new Uint8Array(4 * width * height);
  let at = start;
  const take = (count: number): number => {
    if (at + count > bytes.length) throw new NotHdr("it ends too early");
    at += count;
    return at - count;
  };
  for (let y = 0; y < height; ++y) {
    const row = codes.subarray(4 * width * y, 4 * width * (y + 1));
    const packed =
      width >= kMinRun_px && width <= kMaxRun_px && bytes[at] === 2 && bytes[at + 1] === 2 && bytes[at + 2]! < 128;
    if (!packed) {
      const from = take(4 * width);
      row.set(bytes.subarray(from, from + 4 * width));
      continue;
    }
    take(4);
    // One channel after the other, in runs of one value (above 128) or of several.
    for (let channel = 0; channel < 4; ++channel) {
      for (let x = 0; x < width; ) {
        const length = bytes[take(1)]!;
        const count = length > 128 ? length - 128 : length;
        if (count === 0 || x + count > width) throw new NotHdr(`row ${y} is longer than it should be`);
        const from = take(length > 128 ? 1 : count);
        for (let i = 0; i < count; ++i) row[4 * x++ + channel] = bytes[length > 128 ? from : from + i]!;
      }
    }
  }
  return { width, height, codes };
}
