// Background pictures: built-in ones and files.

export const kBuiltIn = ["landscape", "checks", "gradient", "colour"] as const;
export type BuiltIn = (typeof kBuiltIn)[number];

type Painter = (
  pen: OffscreenCanvasRenderingContext2D,
  width: number,
  height: number,
  colour: string,
) => void;

/** Edges of many directions, colours and sizes, which show everything that the object does to light. */
const landscape: Painter = (pen, width, height) => {
  const sky = pen.createLinearGradient(0, 0, 0, height * 0.6);
  sky.addColorStop(0, "#23477c");
  sky.addColorStop(0.6, "#d98a5b");
  sky.addColorStop(1, "#f6dfa4");
  pen.fillStyle = sky;
  pen.fillRect(0, 0, width, height);
  pen.fillStyle = "#fff3c9";
  pen.beginPath();
  pen.arc(width * 0.68, height * 0.4, height * 0.09, 0, 2 * Math.PI);
  pen.fill();
  const ridges: [string, number, number][] = [
    ["#5d5f86", 0.5, 0.16],
    ["#3c4a63", 0.6, 0.1],
    ["#223541", 0.68, 0.06],
  ];
  for (const [colour, level, swing] of ridges) {
    pen.fillStyle = colour;
    pen.beginPath();
    pen.moveTo(0, height);
    for (let i = 0; i <= 48; ++i) {
      const x = i / 48;
      const rise =
        Math.sin(9 * x + 40 * level) + 0.5 * Math.sin(23 * x + 90 * level) + 0.3 * Math.sin(57 * x);
      pen.lineTo(x * width, height * (level - 0.5 * swing * rise));
    }
    pen.lineTo(width, height);
    pen.fill();
  }
  const rows = 7;
  for (let row = 0; row < rows; ++row) {
    const far = (y: number): number => height * (0.74 + 0.26 * (y / rows) ** 1.6);
    for (let column = -9; column < 9; ++column) {
      const spread = (c: number, y: number): number =>
        width * (0.5 + (c / 9) * (0.35 + 1.1 * (y / rows) ** 1.6));
      pen.fillStyle = (row + column) % 2 === 0 ? "#e8d9b8" : "#8d3b2f";
      pen.beginPath();
      pen.moveTo(spread(column, row), far(row));
      pen.lineTo(spread(column + 1, row), far(row));
      pen.lineTo(spread(column + 1, row + 1), far(row + 1));
      pen.lineTo(spread(column, row + 1), far(row + 1));
      pen.fill();
    }
  }
};

const kPainters: Record<BuiltIn, Painter> = {
  landscape,
  checks: (pen, width, height) => {
    const side = height / 8;
    for (let y = 0; y < 8; ++y) {
      for (let x = 0; x * side < width; ++x) {
        pen.fillStyle = (x + y) % 2 === 0 ? "#ffffff" : "#000000";
        pen.fillRect(x * side, y * side, side, side);
      }
    }
  },
  gradient: (pen, width, height) => {
    const across = pen.createLinearGradient(0, 0, width, 0);
    ["#ff3b30", "#ffd60a", "#34c759", "#32ade6", "#5e5ce6", "#ff2d92"].forEach((colour, i) =>
      across.addColorStop(i / 5, colour),
    );
    pen.fillStyle = across;
    pen.fillRect(0, 0, width, height);
    const down = pen.createLinearGradient(0, 0, 0, height);
    down.addColorStop(0, "#ffffffff");
    down.addColorStop(0.5, "#ffffff00");
    down.addColorStop(1, "#000000ff");
    pen.fillStyle = down;
    pen.fillRect(0, 0, width, height);
  },
  colour: (pen, width, height, colour) => {
    pen.fillStyle = colour;
    pen.fillRect(0, 0, width, height);
  },
};

export function paint(kind: BuiltIn, width: number, height: number, colour: string): ImageBitmap {
  const canvas = new OffscreenCanvas(width, height);
  kPainters[kind](canvas.getContext("2d")!, width, height, colour);
  return canvas.transferToImageBitmap();
}

/** The file's values, interpreted as sRGB as in `glasswing composite`. */
export async function openPicture(
  file: Blob,
  name: string,
  mostSide: number,
  accepted = "PNG, JPEG, WebP and AVIF can",
): Promise<ImageBitmap> {
  const as_is: ImageBitmapOptions = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
  const image = await createImageBitmap(file, as_is).catch(() => {
    throw new Error(`${name} cannot be read by this browser; ${accepted}`);
  });
  const shrink = mostSide / Math.max(image.width, image.height);
  if (shrink >= 1) return image;
  return createImageBitmap(image, {
    ...as_is,
    resizeWidth: Math.floor(image.width * shrink),
    resizeHeight: Math.floor(image.height * shrink),
    resizeQuality: "high",
  });
}
