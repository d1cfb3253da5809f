// Environments: built-in ones and files.
import type { Environment } from "../light/environment";
import { isExr, readExrPicture } from "../light/exr_picture";
import { isHdr, putLight, readHdr, type Hdr } from "../light/hdr";
import { openPicture } from "./backgrounds";

export const kBuiltInEnvironments = ["evening", "room"] as const;
export type BuiltInEnvironment = (typeof kBuiltInEnvironments)[number];

type Light = [number, number, number];
/** By longitude and height, both rad: 0 lies ahead, on the horizon. */
type Scene = (lon: number, height: number) => Light;

const scaled = ([r, g, b]: Light, by: number): Light => [by * r, by * g, by * b];
const mixed = (a: Light, b: Light, share: number): Light =>
  a.map((each, c) => each + share * (b[c]! - each)) as Light;
/** 1 or 0 in turns. */
const turns = (at: number): number => Math.floor(at) & 1;

/** A low sun of a hundred times the sky's light, hills, and a floor of tiles. */
const evening: Scene = (lon, height) => {
  const hills = 0.1 + 0.05 * Math.sin(3 * lon) + 0.03 * Math.sin(11 * lon + 1) + 0.01 * Math.sin(37 * lon);
  if (height > hills) {
    const sky = mixed([0.9, 0.5, 0.25], [0.1, 0.2, 0.5], Math.min(1, height / 0.9) ** 0.7);
    const from = Math.hypot((lon - 0.7) * Math.cos(height), height - 0.3);
    return from < 0.035 ? [60, 45, 25] : mixed(sky, [2, 1.3, 0.7], Math.exp(-4 * from) * 0.8);
  }
  if (height > 0) return scaled(mixed([0.05, 0.07, 0.09], [0.3, 0.2, 0.15], 1 - height / hills), 0.8);
  // The eye is three tiles above the floor.
  const away = 3 / Math.tan(-height);
  const tile = turns(away * Math.sin(lon)) ^ turns(away * Math.cos(lon));
  const near: Light = tile ? [0.5, 0.42, 0.3] : [0.14, 0.07, 0.05];
  return mixed(near, [0.3, 0.2, 0.14], Math.min(1, away / 40));
};

/** Dark, with two bright windows, a coloured wall, and lamps along the ceiling. */
const room: Scene = (lon, height) => {
  const wall = Math.max(Math.abs(Math.sin(lon)), Math.abs(Math.cos(lon))); // of a square room, over its distance
  const up = Math.tan(height) / wall; // on the wall, in half sides
  const across = Math.abs(Math.sin(lon)) > Math.abs(Math.cos(lon)) ? 1 / Math.tan(lon) : Math.tan(lon);
  if (Math.abs(up) > 0.6) {
    const [x, z] = [Math.sin(lon), Math.cos(lon)].map((each) => (0.6 * each * wall) / Math.abs(up * wall)) as [
      number,
      number,
    ];
    if (up < 0) return scaled([0.35, 0.22, 0.12], 0.6 + 0.4 * turns(10 * x));
    return Math.abs(Math.abs(x) - 0.5) < 0.06 && Math.abs(z) < 0.8 ? [12, 11, 9] : [0.3, 0.3, 0.28];
  }
  const side = Math.round(lon / (Math.PI / 2)) & 3;
  const isWindow = side % 2 === 1 && Math.abs(Math.abs(across) - 0.35) < 0.25 && Math.abs(up - 0.1) < 0.3;
  if (isWindow) return [5, 6, 7.5];
  const colours: Light[] = [[0.25, 0.22, 0.18], [0.2, 0.2, 0.2], [0.45, 0.09, 0.05], [0.2, 0.2, 0.2]];
  return scaled(colours[side]!, turns(8 * across) ? 1 : 0.7);
};

const kScenes: Record<BuiltInEnvironment, Scene> = { evening, room };
const kBuiltInWidth = 2048;

export function paintEnvironment(kind: BuiltInEnvironment): Hdr {
  const [width, height] = [kBuiltInWidth, kBuiltInWidth / 2];
  const codes = new Uint8Array(4 * width * height);
  for (let v = 0; v < height; ++v)
    for (let u = 0; u < width; ++u) {
      const light = kScenes[kind](2 * Math.PI * ((u + 0.5) / width - 0.5), Math.PI * (0.5 - (v + 0.5) / height));
      putLight(codes, v * width + u, ...light);
    }
  return { width, height, codes };
}

/** Equirectangular: OpenEXR, Radiance's .hdr, or a picture in sRGB as in `glasswing composite`. */
export async function openEnvironment(file: Blob, name: string, mostSide: number): Promise<Environment> {
  const head = new Uint8Array(await file.slice(0, 4).arrayBuffer());
  if (!isHdr(head) && !isExr(head))
    return openPicture(file, name, mostSide, "OpenEXR, Radiance's .hdr, PNG, JPEG, WebP and AVIF can");
  const bytes = new Uint8Array(await file.arrayBuffer());
  const hdr = isExr(head) ? await readExrPicture(bytes) : readHdr(bytes);
  if (Math.max(hdr.width, hdr.height) > mostSide)
    throw new Error(
      `${name} is ${hdr.width}x${hdr.height}; this graphics processor takes environments of up to ${mostSide} px`,
    );
  return hdr;
}
