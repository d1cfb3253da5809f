// Writes a small OpenEXR file of several parts, by openexr.com's file layout.
import { deflateSync } from "node:zlib";

export interface PartText {
  name: string;
  /** Channels sorted by name, with the samples of all lines. */
  channels: Record<string, number[]>;
  attributes?: Record<string, string>;
}

function int(value: number): Buffer {
  const out = Buffer.alloc(4);
  out.writeInt32LE(value);
  return out;
}
const text = (value: string): Buffer => Buffer.from(`${value}\0`);
const attribute = (name: string, type: string, value: Buffer): Buffer =>
  Buffer.concat([text(name), text(type), int(value.length), value]);

function header(part: PartText, width: number, height: number): Buffer {
  const window = Buffer.concat([0, 0, width - 1, height - 1].map(int));
  const channels = Object.keys(part.channels).map((name) =>
    Buffer.concat([text(name), int(2), int(0), int(1), int(1)]),
  );
  const strings = { name: part.name, type: "scanlineimage", ...part.attributes };
  return Buffer.concat([
    attribute("channels", "chlist", Buffer.concat([...channels, Buffer.from([0])])),
    attribute("compression", "compression", Buffer.from([2])),
    attribute("dataWindow", "box2i", window),
    attribute("displayWindow", "box2i", window),
    attribute("chunkCount", "int", int(height)),
    ...Object.entries(strings).map(([name, value]) => attribute(name, "string", Buffer.from(value))),
    Buffer.from([0]),
  ]);
}

/** OpenEXR's interleaving and predictor: even bytes before odd ones, then differences + 128. */
export function predict(line: Buffer): Buffer {
  const split = Buffer.concat([line.filter((_, i) => i % 2 === 0), line.filter((_, i) => i % 2 === 1)]);
  return Buffer.from(split.map((value, i) => (i === 0 ? value : (value - split[i - 1]! + 128) & 255)));
}

export function exrBytes(parts: PartText[], width: number, height: number): Uint8Array<ArrayBuffer> {
  const head = Buffer.concat([
    int(20000630),
    int(2 | 0x1000 | 0x400),
    ...parts.map((part) => header(part, width, height)),
    Buffer.from([0]),
  ]);
  const chunks: Buffer[] = [];
  const places = parts.map(() => Buffer.alloc(8 * height));
  let at = head.length + 8 * height * parts.length;
  for (let y = 0; y < height; ++y) {
    parts.forEach((part, p) => {
      const samples = Object.values(part.channels).flatMap((values) =>
        values.slice(y * width, (y + 1) * width),
      );
      const line = Buffer.from(new Float32Array(samples).buffer);
      const packed = deflateSync(predict(line), { level: 1 });
      const data = packed.length < line.length ? packed : line;
      places[p]!.writeBigUInt64LE(BigInt(at), 8 * y);
      chunks.push(int(p), int(y), int(data.length), data);
      at += 12 + data.length;
    });
  }
  return new Uint8Array(Buffer.concat([head, ...places, ...chunks]));
}
