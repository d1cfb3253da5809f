// Files of a tar archive (POSIX ustar, with pax paths as the console's own downloads have them), found by their headers:
// contents are not read.

const kBlock = 512;
const kMaxPax = 64 * 1024; // bytes of a file's pax records

const text = (bytes: Uint8Array): string => new TextDecoder().decode(bytes).replace(/\0.*$/s, "");
const octal = (bytes: Uint8Array): number => {
  const digits = text(bytes).trim();
  return /^[0-7]+$/.test(digits) ? parseInt(digits, 8) : NaN;
};

function isHeader(block: Uint8Array): boolean {
  let sum = 0;
  block.forEach((byte, at) => (sum += at >= 148 && at < 156 ? 32 : byte));
  return octal(block.subarray(148, 156)) === sum;
}

/** The path in pax records ("27 path=vase/frames/17.tif\n"); undefined: they have none. */
function pathIn(records: Uint8Array): string | undefined {
  for (let at = 0; at < records.length;) {
    const size = parseInt(new TextDecoder().decode(records.subarray(at, at + 12)), 10);
    if (!(size > 0)) return undefined;
    const record = new TextDecoder().decode(records.subarray(at, at + size - 1));
    const found = /^\d+ path=(.*)$/s.exec(record);
    if (found) return found[1];
    at += size;
  }
  return undefined;
}

/** The archive's files by path. An error if `tar` is none, ends early, or has more than `maxCount` files. */
export async function filesOfTar(tar: Blob, maxCount: number): Promise<Map<string, Blob>> {
  const read = async (at: number, size: number): Promise<Uint8Array> =>
    new Uint8Array(await tar.slice(at, at + size).arrayBuffer());
  const files = new Map<string, Blob>();
  let path: string | undefined;
  for (let at = 0; ;) {
    const block = await read(at, kBlock);
    if (block.length < kBlock) throw new Error("it is truncated: a tar file ends with empty blocks");
    if (block.every((byte) => byte === 0)) return files;
    const size = octal(block.subarray(124, 136));
    if (!isHeader(block) || Number.isNaN(size)) throw new Error("it is not a tar file, or damaged");
    const type = String.fromCharCode(block[156]!);
    const begin = at + kBlock;
    if (begin + size > tar.size) throw new Error("it is truncated");
    if (type === "x") {
      if (size > kMaxPax) throw new Error(`a path's records have more than ${kMaxPax} bytes`);
      path = pathIn(await read(begin, size));
    } else {
      const prefix = text(block.subarray(345, 500));
      path ??= (prefix ? `${prefix}/` : "") + text(block.subarray(0, 100));
      if (type === "0" || type === "\0") files.set(path, tar.slice(begin, begin + size));
      if (files.size > maxCount) throw new Error(`it has more than ${maxCount} files`);
      path = undefined;
    }
    at = begin + Math.ceil(size / kBlock) * kBlock;
  }
}
