// Holds what the page draws against what `glasswing composite` writes, picture by picture:
//
//   node tests/browser/composite_test.mjs GLASSWING MATTE.exr [PICTURE.png]...
//
// Beside the pictures given there are checks of one pixel and noise. Every monitor of the matte shows the same picture. Prints the mean
// and the largest difference of a colour, in 1/255 of sRGB, and fails where a mean is above 2.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { open_browser } from "./browser.mjs";
import { checks, noise, png } from "./pictures.mjs";
import { stand_in } from "./stand_in.mjs";

const kMostMean = 2;

const [glasswing, matte, ...given] = process.argv.slice(2);
if (matte === undefined) {
  console.error("usage: composite_test.mjs GLASSWING MATTE.exr [PICTURE.png]...");
  process.exit(2);
}
const folder = mkdtempSync(join(tmpdir(), "composite-"));
/** The monitors in the header's JSON. */
function monitors_of(file) {
  const text = readFileSync(file).toString("latin1");
  const start = text.indexOf("{", text.indexOf("glasswing\0string\0"));
  let end = start;
  for (let depth = 0; depth > 0 || end === start; ++end) depth += { "{": 1, "}": -1 }[text[end]] ?? 0;
  return JSON.parse(text.slice(start, end)).monitors;
}
const monitors = monitors_of(matte);

const [first] = monitors;
const made = (name, colour) => {
  const file = join(folder, `${name}.png`);
  writeFileSync(file, png(first.width_px, first.height_px, colour));
  return file;
};
const pictures = [...given, made("checks", checks(1)), made("noise", noise(20261122))];

/** Mean and largest difference of two PNG files' colours, looked at by the browser. */
async function difference(page, one, other) {
  const encoded = [one, other].map((file) => readFileSync(file).toString("base64"));
  return page.evaluate(async (files) => {
    const [a, b] = await Promise.all(files.map(async (text) => {
      const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none" });
      const pen = new OffscreenCanvas(image.width, image.height).getContext("2d");
      pen.drawImage(image, 0, 0);
      return { width: image.width, height: image.height, data: pen.getImageData(0, 0, image.width, image.height).data };
    }));
    if (a.width !== b.width || a.height !== b.height) throw new Error(`${a.width}x${a.height} is not ${b.width}x${b.height}`);
    let sum = 0, most = 0, worst = 0;
    for (let i = 0; i < a.data.length; ++i) {
      const away = Math.abs(a.data[i] - b.data[i]);
      sum += away;
      if (away > most) [most, worst] = [away, i >> 2];
    }
    return { mean: sum / (a.width * a.height * 3), most, x: worst % a.width, y: Math.floor(worst / a.width) };  // alpha is 255 in both
  }, encoded);
}

async function show(page, picture) {
  for (const [t] of monitors.entries()) {
    if (monitors.length > 1) await page.getByLabel("Monitor").selectOption(String(t));
    await page.locator("input[type=file]").setInputFiles(picture);
    await page.locator("option[value=file]", { hasText: basename(picture) }).waitFor({ state: "attached" });
  }
}

const server = await stand_in({
  mattes: { "/mattes/it.exr": matte },
  answer: (path) => (path.endsWith("/GetSession") ? { session: { name: "it", matteReady: true } } : undefined),
});
const browser = await open_browser();
let failed = false;
try {
  const page = await browser.newPage();
  page.on("console", (message) => message.type() === "error" && console.error(message.text()));
  page.on("pageerror", (error) => console.error(error.message));
  await page.goto(`${server.url}/#/play/it`);
  const download = page.getByRole("button", { name: "Download frame" });
  await download.waitFor();
  console.log(`${basename(matte)}                mean  largest, of 255`);
  for (const picture of pictures) {
    await show(page, picture);
    const [drawn] = await Promise.all([page.waitForEvent("download"), download.click()]);
    const ours = join(folder, "page.png"), theirs = join(folder, "composite.png");
    await drawn.saveAs(ours);
    const behind = monitors.flatMap(({ name }) => ["--background", `${name}=${picture}`]);
    execFileSync(glasswing, ["composite", matte, ...behind, "-o", theirs], { stdio: "pipe" });
    const { mean, most, x, y } = await difference(page, ours, theirs);
    failed ||= !(mean <= kMostMean);
    console.log(`${basename(picture).padEnd(24)} ${mean.toFixed(3).padStart(8)} ${String(most).padStart(8)} at ${x},${y}`);
  }
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
}
process.exit(failed ? 1 : 0);
