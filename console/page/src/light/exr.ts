// Reads the subset of OpenEXR that mattes use: several parts of scan lines, 32-bit floats, each line compressed by itself
// (ZIPS). Sizes and offsets are checked against the file's size before use.

export interface ExrPart {
  name: string;
  channels: string[];
  attributes: Map<string, string>;
  /** Offset of each line's chunk. */
  chunks: number[];
}

export interface Exr {
  bytes: Uint8Array<ArrayBuffer>;
  /** The data window. */
  window: { x0: number; y0: number; width: number; height: number };
  parts: ExrPart[];
}

export const kMagic = 20000630;
const kVersion = 2;
const kMultiPart = 0x1000;
const kLongNames = 0x400;
const kZips = 2;
const kFloat = 2;
const kMaxSide = 1 << 16;
const kMaxPixels = 1 << 26;
const kMaxParts = 16;

export class NotAMatte extends Error {
  constructor(what: string) {
    super(`the file is damaged or not a matte: ${what}`);
  }
}

/** Reads a file's little-endian values one after the other. `refused`: makes the error of a file that is not what it should
 * be. */
export class Cursor {
  at = 0;
  private readonly view: DataView;
  constructor(
    private readonly bytes: Uint8Array<ArrayBuffer>,
    private readonly refused: (what: string) => Error = (what) => new NotAMatte(what),
  ) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }
  skip(size: number): number {
    const start = this.at;
    if (size < 0 || start + size > this.bytes.length) throw this.refused("it ends too early");
    this.at += size;
    return start;
  }
  int(): number {
    return this.view.getInt32(this.skip(4), true);
  }
  offset(): number {
    return Number(this.view.getBigUint64(this.skip(8), true));
  }
  text(size: number): string {
    const start = this.skip(size);
    return new TextDecoder().decode(this.bytes.subarray(start, start + size));
  }
  name(): string {
    const end = this.bytes.indexOf(0, this.at);
    if (end < 0 || end - this.at > 255) throw this.refused("a name in its header is not terminated");
    const name = this.text(end - this.at);
    this.skip(1);
    return name;
  }
}

function readChannels(cursor: Cursor): string[] {
  const channels: string[] = [];
  for (let name = cursor.name(); name !== ""; name = cursor.name()) {
    if (cursor.int() !== kFloat) throw new NotAMatte(`its channel ${name} is not of 32-bit floats`);
    cursor.skip(12);
    channels.push(name);
  }
  return channels;
}

interface Header {
  part: ExrPart;
  window: Exr["window"];
  lines: number;
}

function isSize({ width, height }: Exr["window"]): boolean {
  return width >= 1 && height >= 1 && Math.max(width, height) <= kMaxSide && width * height <= kMaxPixels;
}

function readHeader(cursor: Cursor, firstName: string): Header {
  const part: ExrPart = { name: "", channels: [], attributes: new Map(), chunks: [] };
  let window: Exr["window"] | undefined;
  let lines = -1;
  let packing = -1;
  for (let name = firstName; name !== ""; name = cursor.name()) {
    const type = cursor.name();
    const size = cursor.int();
    const end = cursor.at + size;
    if (type === "string") part.attributes.set(name, cursor.text(size));
    else if (type === "chlist" && name === "channels") part.channels = readChannels(cursor);
    else if (type === "box2i" && name === "dataWindow") {
      const [x0, y0, x1, y1] = [cursor.int(), cursor.int(), cursor.int(), cursor.int()];
      window = { x0, y0, width: x1 - x0 + 1, height: y1 - y0 + 1 };
    } else if (type === "int" && name === "chunkCount") lines = cursor.int();
    else if (type === "compression") packing = cursor.text(1).charCodeAt(0);
    else cursor.skip(size);
    if (cursor.at !== end) throw new NotAMatte(`its attribute ${name} has a wrong length`);
  }
  part.name = part.attributes.get("name") ?? "";
  if (part.attributes.get("type") !== "scanlineimage" || packing !== kZips)
    throw new NotAMatte(`its part "${part.name}" is not of single scan lines (ZIPS)`);
  if (!window || !isSize(window))
    throw new NotAMatte(`its part "${part.name}" has no size of 1 to ${kMaxPixels} pixels`);
  return { part, window, lines };
}

export function readExr(bytes: Uint8Array<ArrayBuffer>): Exr {
  const cursor = new Cursor(bytes);
  if (bytes.length < 8 || cursor.int() !== kMagic) throw new NotAMatte("it does not begin like an OpenEXR file");
  if ((cursor.int() & ~kLongNames) !== (kVersion | kMultiPart))
    throw new NotAMatte("it is not a multi-part OpenEXR file");
  const headers: Header[] = [];
  for (let name = cursor.name(); name !== ""; name = cursor.name()) {
    if (headers.length === kMaxParts) throw new NotAMatte(`it has more than ${kMaxParts} parts`);
    headers.push(readHeader(cursor, name));
  }
  const first = headers[0];
  if (!first) throw new NotAMatte("it has no parts");
  for (const { part, window, lines } of headers) {
    if (JSON.stringify(window) !== JSON.stringify(first.window) || lines !== window.height)
      throw new NotAMatte(`its part "${part.name}" differs in size from the others`);
    for (let line = 0; line < lines; ++line) part.chunks.push(cursor.offset());
  }
  return { bytes, window: first.window, parts: headers.map(({ part }) => part) };
}

/** Throws if there are not `size` bytes. */
export async function inflate(
  packed: Uint8Array<ArrayBuffer>,
  size: number,
  refused: (what: string) => Error = (what) => new NotAMatte(what),
): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new DecompressionStream("deflate");
  const writer = stream.writable.getWriter();
  // Failures are reported where the stream is read.
  void writer.write(packed).catch(() => undefined);
  void writer.close().catch(() => undefined);
  const out = new Uint8Array(size);
  let length = 0;
  const reader = stream.readable.getReader();
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    if (length + value.length > size) throw refused("a line is longer than it should be");
    out.set(value, length);
    length += value.length;
  }
  if (length !== size) throw refused("a line is shorter than it should be");
  return out;
}

/** Undoes OpenEXR's predictor and interleaving: the even bytes come before the odd ones, each as a difference. */
export function unpredict(split: Uint8Array): Uint8Array<ArrayBuffer> {
  const out = new Uint8Array(split.length);
  const half = (split.length + 1) >> 1;
  let value = 128;
  for (let i = 0; i < half; ++i) out[2 * i] = value = (value + split[i]! - 128) & 255;
  for (let i = half; i < split.length; ++i) out[2 * (i - half) + 1] = value = (value + split[i]! - 128) & 255;
  return out;
}

/** The samples of one line, channel by channel in the part's order. `row` counts from the top of the data window. */
export async function readLine(exr: Exr, partIndex: number, row: number): Promise<Float32Array> {
  const part = exr.parts[partIndex]!;
  const { width, y0 } = exr.window;
  const size = 4 * width * part.channels.length;
  const cursor = new Cursor(exr.bytes);
  cursor.skip(part.chunks[row]!);
  if (cursor.int() !== partIndex || cursor.int() !== y0 + row)
    throw new NotAMatte(`line ${y0 + row} of part "${part.name}" is not where its table says`);
  const packed = cursor.int();
  const start = cursor.skip(packed);
  const bytes = exr.bytes.subarray(start, start + packed);
  // A line that compression would not shorten is stored as it is.
  const line =
    packed === size
      ? bytes.slice()
      : unpredict(await inflate(bytes, size).catch(notThisLine(y0 + row, part)));
  return new Float32Array(line.buffer);
}

function notThisLine(y: number, part: ExrPart) {
  return (error: unknown): never => {
    throw error instanceof NotAMatte
      ? error
      : new NotAMatte(`line ${y} of part "${part.name}" cannot be unpacked`);
  };
}
