// Encodes a linear PNG with 16 bits per colour, the format of uploaded photos. (Canvases write 8 bits, too few for dark linear
// light.)
import { lightOf } from "../light/srgb";

const kSignature = [137, 80, 78, 71, 13, 10, 26, 10];

const kCrcs = Uint32Array.from({ length: 256 }, (_, byte) => {
  let crc = byte;
  for (let bit = 0; bit < 8; ++bit) crc = crc & 1 ? 0xedb88320 ^ (crc >>> 1) : crc >>> 1;
  return crc;
});

function crc32(bytes: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of bytes) crc = kCrcs[(crc ^ byte) & 255]! ^ (crc >>> 8);
  return ~crc >>> 0;
}

function chunk(kind: string, data: Uint8Array): Uint8Array<ArrayBuffer> {
  const out = new Uint8Array(12 + data.length);
  const view = new DataView(out.buffer);
  view.setUint32(0, data.length);
  out.set(new TextEncoder().encode(kind), 4);
  out.set(data, 8);
  view.setUint32(8 + data.length, crc32(out.subarray(4, 8 + data.length)));
  return out;
}

async function deflated(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const packed = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate"));
  return new Uint8Array(await new Response(packed).arrayBuffer());
}

/** `codes`: sRGB r, g, b, alpha, 0 to 255, row by row; alpha is ignored. */
export async function linearPng({
  data,
  width,
  height,
}: {
  data: Uint8ClampedArray;
  width: number;
  height: number;
}): Promise<Blob> {
  const lights = Uint16Array.from({ length: 256 }, (_, code) => Math.round(65535 * lightOf(code / 255)));
  const rows = new Uint8Array(height * (1 + 6 * width)); // each begins with its filter: none
  const view = new DataView(rows.buffer);
  let at = 0;
  for (let i = 0; i < data.length; i += 4) {
    if ((i >> 2) % width === 0) ++at;
    for (let colour = 0; colour < 3; ++colour, at += 2) view.setUint16(at, lights[data[i + colour]!]!);
  }
  const header = new Uint8Array(13);
  new DataView(header.buffer).setUint32(0, width);
  new DataView(header.buffer).setUint32(4, height);
  header.set([16, 2], 8); // bits, r g b
  const parts = [chunk("IHDR", header), chunk("IDAT", await deflated(rows)), chunk("IEND", new Uint8Array())];
  return new Blob([new Uint8Array(kSignature), ...parts], { type: "image/png" });
}
