import { kLayers, type Mode } from "../../src/light/matte";
import { exrBytes, type PartText } from "./exr_bytes";

const kNone: Mode = { weight: 0, x: 0, y: 0, xx: 0, xy: 0, yy: 0, texture: 0, weight_sd: 0, centre_sd: 0 };

export interface MatteText {
  width: number;
  height: number;
  metadata: object;
  suffixes: string[];
  modeCount: number;
  foreground: (pixel: number, channel: number) => number;
  modes: (pixel: number, channel: number) => Mode[];
  /** The numbers of each row's pyramids. */
  pyramids?: number[][];
}

/** The bytes of a matte's file. */
export function matteBytes({
  width,
  height,
  metadata,
  suffixes,
  modeCount,
  foreground,
  modes,
  pyramids,
}: MatteText): Uint8Array<ArrayBuffer> {
  const pixels = Array.from({ length: width * height }, (_, pixel) => pixel);
  const attributes = { glasswing: JSON.stringify(metadata) };
  const sorted = (channels: Record<string, number[]>): Record<string, number[]> =>
    Object.fromEntries(Object.entries(channels).sort(([a], [b]) => (a < b ? -1 : 1)));
  const none = pixels.map(() => 0);
  const parts: PartText[] = [
    { name: "preview", channels: { A: none, B: none, G: none, R: none }, attributes },
    {
      name: "foreground",
      channels: sorted({
        "foreground.coverage.Y": pixels.map(() => 1),
        "foreground.flags.Y": none,
        ...Object.fromEntries(
          ["R", "G", "B"].map((name, c) => [
            `foreground.F.${name}`,
            pixels.map((pixel) => foreground(pixel, c)),
          ]),
        ),
      }),
      attributes,
    },
  ];
  for (let m = 0; m < modeCount; ++m) {
    const layers = kLayers.flatMap((layer) =>
      suffixes.map((suffix, c): [string, number[]] => [
        `mode${m + 1}.${layer}.${suffix}`,
        pixels.map((pixel) => (modes(pixel, c)[m] ?? kNone)[layer]),
      ]),
    );
    parts.push({ name: `mode${m + 1}`, channels: sorted(Object.fromEntries(layers)), attributes });
  }
  if (pyramids) {
    const planes = Array.from({ length: 512 }, (_, plane): [string, number[]] => [
      `pyramid.${String(plane).padStart(3, "0")}.Y`,
      pixels.map((pixel) => pyramids[Math.floor(pixel / width)]![plane * width + (pixel % width)] ?? 0),
    ]);
    parts.push({ name: "pyramid", channels: Object.fromEntries(planes), attributes });
  }
  return exrBytes(parts, width, height);
}
