// OpenEXR's compression PIZ (ImfPizCompressor, ImfHuf, ImfWav): the 16-bit words of some lines that occur are numbered, the
// numbers go through a wavelet of whole numbers, and those through a Huffman code with runs.

type Refused = (what: string) => Error;

const kWords = 1 << 16;
const kMaxLength = 58; // of a code, bits
const [kShortRun, kLongRun] = [59, 63]; // lengths that stand for runs of symbols without a code
const kFastBits = 12;

/** Bits from the first byte's highest on. */
class Bits {
  private at = 0;
  private held = 0;
  private count = 0;
  constructor(
    private readonly bytes: Uint8Array,
    private readonly refused: Refused,
  ) {}
  /** Up to 24. */
  get(count: number): number {
    this.fill(count);
    if (this.count < count) throw this.refused("a code ends too early");
    this.count -= count;
    return (this.held >>> this.count) & ((1 << count) - 1);
  }
  /** The next bits without taking them; beyond the end zeros. */
  peek(count: number): number {
    this.fill(count);
    const missing = Math.max(0, count - this.count);
    return ((this.held << missing) >>> (this.count + missing - count)) & ((1 << count) - 1);
  }
  skip(count: number): void {
    if (this.count < count) throw this.refused("a code ends too early");
    this.count -= count;
  }
  /** Of whole bytes, those begun included. */
  get taken(): number {
    return this.at - (this.count >> 3);
  }
  private fill(count: number): void {
    for (; this.count < count && this.at < this.bytes.length; this.count += 8)
      this.held = ((this.held & 0xffffff) << 8) | this.bytes[this.at++]!;
  }
}

interface Codes {
  /** By length: the first code, and where its symbols begin in `symbols`. */
  first: Float64Array;
  begin: Int32Array;
  symbols: Int32Array;
  /** By the next bits: symbol * 64 + length of a short code; 0: a longer one. */
  fast: Int32Array;
}

/** Lengths of symbols' codes -> canonical codes: longer ones have smaller values. */
function codesOf(lengths: Uint8Array): Codes {
  const counts = new Int32Array(kMaxLength + 2);
  for (const length of lengths) if (length > 0) ++counts[length]!;
  const first = new Float64Array(kMaxLength + 2);
  for (let length = kMaxLength, code = 0; length > 0; --length) {
    first[length] = code;
    code = Math.floor((code + counts[length]!) / 2);
  }
  const begin = new Int32Array(kMaxLength + 2);
  for (let length = 1; length <= kMaxLength; ++length) begin[length + 1] = begin[length]! + counts[length]!;
  const symbols = new Int32Array(begin[kMaxLength + 1]!);
  const next = begin.slice();
  lengths.forEach((length, symbol) => {
    if (length > 0) symbols[next[length]!++] = symbol;
  });
  const fast = new Int32Array(1 << kFastBits);
  for (let length = 1; length <= kFastBits; ++length)
    for (let i = 0; i < counts[length]!; ++i) {
      const from = (first[length]! + i) * 2 ** (kFastBits - length);
      fast.fill(symbols[begin[length]! + i]! * 64 + length, from, from + 2 ** (kFastBits - length));
    }
  return { first, begin, symbols, fast };
}

function lengthsOf(bits: Bits, from: number, to: number, refused: Refused): Uint8Array {
  const lengths = new Uint8Array(kWords + 1);
  for (let symbol = from; symbol <= to; ) {
    const length = bits.get(6);
    if (length < kShortRun) {
      lengths[symbol++] = length;
      continue;
    }
    symbol += length === kLongRun ? bits.get(8) + 2 + kLongRun - kShortRun : length - kShortRun + 2;
    if (symbol > to + 1) throw refused("a table of codes is longer than it should be");
  }
  return lengths;
}

function nextSymbol(bits: Bits, { first, begin, symbols, fast }: Codes, refused: Refused): number {
  const found = fast[bits.peek(kFastBits)]!;
  if (found > 0) {
    bits.skip(found & 63);
    return found >> 6;
  }
  let code = bits.get(kFastBits);
  for (let length = kFastBits + 1; length <= kMaxLength; ++length) {
    code = 2 * code + bits.get(1);
    const at = code - first[length]!;
    if (at >= 0 && at < begin[length + 1]! - begin[length]!) return symbols[begin[length]! + at]!;
  }
  throw refused("a code is not in its table");
}

/** `packed`: first and last symbol, three more numbers of 32 bits, the codes' lengths, and the codes. */
function unhuffman(packed: Uint8Array, count: number, refused: Refused): Uint16Array {
  const out = new Uint16Array(count);
  if (count === 0) return out;
  if (packed.length < 20) throw refused("a table of codes ends too early");
  const head = new DataView(packed.buffer, packed.byteOffset, 20);
  const [from, to] = [head.getUint32(0, true), head.getUint32(4, true)];
  if (from > kWords || to > kWords || from > to) throw refused(`codes are of the words ${from} to ${to}`);
  const table = new Bits(packed.subarray(20), refused);
  const codes = codesOf(lengthsOf(table, from, to, refused));
  const bits = new Bits(packed.subarray(20 + table.taken), refused);
  // The last symbol repeats the word before.
  for (let at = 0; at < count; ) {
    const symbol = nextSymbol(bits, codes, refused);
    if (symbol !== to) {
      out[at++] = symbol;
      continue;
    }
    const run = bits.get(8);
    if (at === 0 || at + run > count) throw refused("a run is longer than it should be");
    out.fill(out[at - 1]!, at, at + run);
    at += run;
  }
  return out;
}

/** Undoes one step of the wavelet for a pair of words: their mean and difference, of 14 bits or of 16. */
function pair(words: Uint16Array, low: number, high: number, is14: boolean): void {
  const [l, h] = [words[low]!, words[high]!];
  if (is14) {
    const difference = (h << 16) >> 16;
    const a = ((l << 16) >> 16) + (difference & 1) + (difference >> 1);
    words[low] = a;
    words[high] = a - difference;
  } else {
    const b = l - (h >> 1);
    words[high] = b;
    words[low] = h + words[high]! - 0x8000;
  }
}

/** Of `nx` x `ny` words from `begin` on, `dx` and `dy` apart; none is above `most`. */
function unwavelet(words: Uint16Array, begin: number, [nx, dx]: [number, number], [ny, dy]: [number, number], most: number): void {
  const is14 = most < 1 << 14;
  let twice = 1;
  while (2 * twice <= Math.min(nx, ny)) twice *= 2;
  for (let step = twice >> 1; step >= 1; twice = step, step >>= 1) {
    let y = 0;
    for (; y <= ny - twice; y += twice) {
      let x = 0;
      for (; x <= nx - twice; x += twice) {
        const at = begin + x * dx + y * dy;
        const [right, down] = [at + step * dx, at + step * dy];
        const across = down + step * dx;
        pair(words, at, down, is14);
        pair(words, right, across, is14);
        pair(words, at, right, is14);
        pair(words, down, across, is14);
      }
      if (nx & step) pair(words, begin + x * dx + y * dy, begin + x * dx + (y + step) * dy, is14);
    }
    if (ny & step)
      for (let x = 0; x <= nx - twice; x += twice)
        pair(words, begin + x * dx + y * dy, begin + (x + step) * dx + y * dy, is14);
  }
}

/** The words that occur, by their numbers, and the largest number. */
function wordsOf(packed: Uint8Array, refused: Refused): { table: Uint16Array; most: number; end: number } {
  if (packed.length < 8) throw refused("a block ends too early");
  const head = new DataView(packed.buffer, packed.byteOffset, 4);
  const [from, to] = [head.getUint16(0, true), head.getUint16(2, true)];
  if (to >= kWords / 8) throw refused("a table of words is longer than it should be");
  const end = from <= to ? 4 + to - from + 1 : 4;
  const table = new Uint16Array(kWords);
  let count = 0;
  for (let word = 0; word < kWords; ++word) {
    const byte = word >> 3;
    const occurs = byte >= from && byte <= to && (packed[4 + byte - from]! >> (word & 7)) & 1;
    if (word === 0 || occurs) table[count++] = word;
  }
  return { table, most: count - 1, end };
}

/** Lines of `width` samples of each channel, one channel after the other in each line; `sizes`: their 16-bit words. */
export function unpiz(packed: Uint8Array, width: number, lines: number, sizes: number[], refused: Refused): Uint8Array {
  const { table, most, end } = wordsOf(packed, refused);
  if (packed.length < end + 4) throw refused("a block ends too early");
  const length = new DataView(packed.buffer, packed.byteOffset + end, 4).getInt32(0, true);
  if (length < 0 || end + 4 + length > packed.length) throw refused("a block ends too early");
  const perLine = width * sizes.reduce((sum, size) => sum + size, 0);
  const words = unhuffman(packed.subarray(end + 4, end + 4 + length), perLine * lines, refused);
  const out = new Uint16Array(perLine * lines);
  let begin = 0;
  let column = 0;
  for (const size of sizes) {
    for (let j = 0; j < size; ++j) unwavelet(words, begin + j, [width, size], [lines, width * size], most);
    for (let y = 0; y < lines; ++y)
      for (let i = 0; i < width * size; ++i) out[y * perLine + column + i] = table[words[begin + y * width * size + i]!]!;
    begin += width * size * lines;
    column += width * size;
  }
  return new Uint8Array(out.buffer); // of the machine's order, which is little-endian wherever browsers run
}
