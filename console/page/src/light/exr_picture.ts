// Reads pictures in OpenEXR as light (openexr.com, "OpenEXR File Layout"): scan lines of half or float R, G and B, or Y, not
// compressed or by RLE, ZIPS, ZIP or PIZ. Of several parts the first. Of a data window the display window's size does not matter: it
// is the picture, as for `glasswing composite`.
import { Cursor, inflate, kMagic, unpredict } from "./exr";
import { unpiz } from "./exr_piz";
import { fromHalf } from "./half";
import { putLight, type Hdr } from "./hdr";

export class NotExr extends Error {
  constructor(what: string) {
    super(`the file is damaged or an OpenEXR that this page does not read: ${what}`);
  }
}
const refused = (what: string): NotExr => new NotExr(what);

const kCompressions = ["none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"];
const kLinesOf: Record<string, number> = { none: 1, RLE: 1, ZIPS: 1, ZIP: 16, PIZ: 32 };
const [kTiled, kLongNames, kDeep, kMultiPart] = [0x200, 0x400, 0x800, 0x1000];
const [kHalf, kFloat] = [1, 2];
const kTurn_ms = 30;
const kMaxSide = 1 << 15;
const kMaxPixels = 1 << 26;

interface Channel {
  name: string;
  isHalf: boolean;
}
interface Header {
  channels: Channel[];
  compression: string;
  x0: number;
  y0: number;
  width: number;
  height: number;
}

export function isExr(head: Uint8Array): boolean {
  return head[0] === 0x76 && head[1] === 0x2f && head[2] === 0x31 && head[3] === 0x01;
}

function readChannels(cursor: Cursor): Channel[] {
  const channels: Channel[] = [];
  for (let name = cursor.name(); name !== ""; name = cursor.name()) {
    const type = cursor.int();
    cursor.skip(4);
    const [x, y] = [cursor.int(), cursor.int()];
    if (type !== kHalf && type !== kFloat) throw refused(`its channel ${name} has integer samples`);
    if (x !== 1 || y !== 1) throw refused(`its channel ${name} has fewer samples than pixels`);
    channels.push({ name, isHalf: type === kHalf });
  }
  return channels;
}

/** `firstName`: of its first attribute. */
function readHeader(cursor: Cursor, firstName: string): Header {
  const header: Header = { channels: [], compression: "", x0: 0, y0: 0, width: 0, height: 0 };
  for (let name = firstName; name !== ""; name = cursor.name()) {
    cursor.name(); // the type
    const size = cursor.int();
    const end = cursor.at + size;
    if (name === "channels") header.channels = readChannels(cursor);
    else if (name === "compression")
      header.compression = kCompressions[cursor.text(1).charCodeAt(0)] ?? "not known";
    else if (name === "dataWindow") {
      const [x0, y0, x1, y1] = [cursor.int(), cursor.int(), cursor.int(), cursor.int()];
      Object.assign(header, { x0, y0, width: x1 - x0 + 1, height: y1 - y0 + 1 });
    } else cursor.skip(size);
    if (cursor.at !== end) throw refused(`its attribute ${name} has a wrong length`);
  }
  const { width, height, compression } = header;
  if (!(width >= 1 && height >= 1 && Math.max(width, height) <= kMaxSide && width * height <= kMaxPixels))
    throw refused(`its size is ${width}x${height}; there must be 1 to ${kMaxPixels} pixels`);
  if (!(compression in kLinesOf))
    throw refused(`its compression is ${compression}; it must be ${Object.keys(kLinesOf).join(", ")}`);
  return header;
}

/** Where the samples of red, green and blue begin in a line, and how they are read. */
function columnsOf({ channels, width }: Header): { at: number; isHalf: boolean }[] {
  const begins = new Map<string, { at: number; isHalf: boolean }>();
  let at = 0;
  for (const { name, isHalf } of channels) {
    begins.set(name, { at, isHalf });
    at += (isHalf ? 2 : 4) * width;
  }
  const wanted = ["R", "G", "B"].map((name) => begins.get(name) ?? begins.get("Y"));
  if (!wanted.every((column) => column !== undefined))
    throw refused(`it has the channels ${channels.map(({ name }) => name).join(", ")}; it must have R, G and B, or Y`);
  return wanted;
}

/** OpenEXR's runs: of one byte, or of several as they are. */
function unrun(packed: Uint8Array, size: number): Uint8Array {
  const out = new Uint8Array(size);
  let at = 0;
  for (let i = 0; i < packed.length; ) {
    const count = (packed[i]! << 24) >> 24;
    const length = count < 0 ? -count : count + 1;
    const taken = count < 0 ? length : 1;
    if (at + length > size || i + 1 + taken > packed.length) throw refused("a line is longer than it should be");
    if (count < 0) out.set(packed.subarray(i + 1, i + 1 + length), at);
    else out.fill(packed[i + 1]!, at, at + length);
    at += length;
    i += 1 + taken;
  }
  if (at !== size) throw refused("a line is shorter than it should be");
  return out;
}

async function unpacked(
  packed: Uint8Array<ArrayBuffer>,
  count: number,
  { channels, compression, width }: Header,
): Promise<Uint8Array> {
  const sizes = channels.map(({ isHalf }) => (isHalf ? 1 : 2));
  const size = 2 * count * width * sizes.reduce((sum, each) => sum + each, 0);
  // What compression would not shorten is stored as it is.
  if (packed.length === size || compression === "none") return packed;
  if (compression === "PIZ") return unpiz(packed, width, count, sizes, refused);
  if (compression === "RLE") return unpredict(unrun(packed, size));
  return unpredict(
    await inflate(packed, size, refused).catch((error: unknown) => {
      throw error instanceof NotExr ? error : refused("a line cannot be unpacked");
    }),
  );
}

let halfTable: Float32Array | undefined;
/** Of all 16-bit floats. */
function halfValues(): Float32Array {
  return (halfTable ??= Float32Array.from({ length: 1 << 16 }, (_, bits) => fromHalf(bits)));
}

/** Skips the headers of further parts. */
function skipParts(cursor: Cursor): void {
  for (let name = cursor.name(); name !== ""; name = cursor.name())
    for (; name !== ""; name = cursor.name()) {
      cursor.name();
      cursor.skip(cursor.int());
    }
}

export async function readExrPicture(bytes: Uint8Array<ArrayBuffer>): Promise<Hdr> {
  const cursor = new Cursor(bytes, refused);
  if (cursor.int() !== kMagic) throw refused("it does not begin like an OpenEXR file");
  const version = cursor.int();
  if ((version & 255) !== 2) throw refused(`its version is ${version & 255}; it must be 2`);
  if (version & (kTiled | kDeep)) throw refused(`it has ${version & kDeep ? "deep data" : "tiles"} and no scan lines`);
  if (version & 0xffff00 & ~(kLongNames | kMultiPart)) throw refused("its version has unknown flags");
  const isMultiPart = (version & kMultiPart) !== 0;
  const header = readHeader(cursor, cursor.name());
  if (isMultiPart) skipParts(cursor);
  const { width, height, y0, compression, channels } = header;
  const columns = columnsOf(header);
  const lineBytes = width * channels.reduce((sum, { isHalf }) => sum + (isHalf ? 2 : 4), 0);
  const lines = kLinesOf[compression]!;
  const codes = new Uint8Array(4 * width * height);
  const halves = halfValues();
  const takeLine = (view: DataView, from: number, row: number): void => {
    const sample = ({ at, isHalf }: { at: number; isHalf: boolean }, x: number): number =>
      isHalf ? halves[view.getUint16(from + at + 2 * x, true)]! : view.getFloat32(from + at + 4 * x, true);
    for (let x = 0; x < width; ++x)
      putLight(codes, row * width + x, sample(columns[0]!, x), sample(columns[1]!, x), sample(columns[2]!, x));
  };
  const table = Array.from({ length: Math.ceil(height / lines) }, () => cursor.offset());
  let since = performance.now();
  for (const place of table) {
    // Between blocks the page stays responsive.
    if (performance.now() - since > kTurn_ms) {
      await new Promise((resolve) => setTimeout(resolve));
      since = performance.now();
    }
    const chunk = new Cursor(bytes, refused);
    chunk.skip(place);
    if (isMultiPart && chunk.int() !== 0) throw refused("a chunk does not belong to its first part");
    const row = chunk.int() - y0;
    if (row < 0 || row >= height || row % lines !== 0) throw refused(`a chunk begins with line ${row + y0}`);
    const count = Math.min(lines, height - row);
    const size = chunk.int();
    const start = chunk.skip(size);
    const block = await unpacked(bytes.subarray(start, start + size), count, header);
    if (block.length !== count * lineBytes) throw refused("a line has a wrong length");
    const view = new DataView(block.buffer, block.byteOffset, block.length);
    for (let i = 0; i < count; ++i) takeLine(view, i * lineBytes, row + i);
  }
  return { width, height, codes };
}
