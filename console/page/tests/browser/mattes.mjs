import { readFileSync } from "node:fs";

/** The JSON of a matte's header. */
function metadata_of(file) {
  const text = readFileSync(file).toString("latin1");
  const start = text.indexOf("{", text.indexOf("glasswing\0string\0"));
  let end = start;
  for (let depth = 0; depth > 0 || end === start; ++end) depth += { "{": 1, "}": -1 }[text[end]] ?? 0;
  return JSON.parse(text.slice(start, end));
}

export const monitors_of = (file) => metadata_of(file).monitors;
export const width_of = (file) => metadata_of(file).width_px;

/**
 * Mean and largest colour difference of two PNG files, 0 to 255, the position of the largest, and the PSNR; the browser decodes
 * them. Pixels that have the colour `not.colour` in one of the pictures `not.files` do not count.
 */
export function difference(page, one, other, not = { files: [], colour: [] }) {
  const encoded = [one, other, ...not.files].map((file) => readFileSync(file).toString("base64"));
  return page.evaluate(async ([files, colour]) => {
    const [a, b, ...others] = await Promise.all(
      files.map(async (text) => {
        const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
        const image = await createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none" });
        const pen = new OffscreenCanvas(image.width, image.height).getContext("2d");
        pen.drawImage(image, 0, 0);
        return pen.getImageData(0, 0, image.width, image.height);
      }),
    );
    if (a.width !== b.width || a.height !== b.height)
      throw new Error(`${a.width}x${a.height} is not ${b.width}x${b.height}`);
    let sum = 0,
      squares = 0,
      most = 0,
      worst = 0,
      count = 0;
    const is_left_out = (at) => others.some(({ data }) => colour.every((value, c) => data[at + c] === value));
    for (let i = 0; i < a.data.length; ++i) {
      if (i % 4 === 3 || is_left_out(i - (i % 4))) continue;
      ++count;
      const away = Math.abs(a.data[i] - b.data[i]);
      sum += away;
      squares += away * away;
      if (away > most) [most, worst] = [away, i >> 2];
    }
    return { mean: sum / count, psnr_db: 10 * Math.log10((255 * 255 * count) / squares), most, x: worst % a.width, y: Math.floor(worst / a.width), count: count / 3 };
  }, [encoded, not.colour]);
}
