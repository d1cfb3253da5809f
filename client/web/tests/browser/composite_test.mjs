// Holds what the page draws against what `glasswing composite` writes, picture by picture:
//
//   node tests/browser/composite_test.mjs GLASSWING MATTE.exr [PICTURE.png]...
//
// Beside the pictures given there are checks of one pixel and noise. Every monitor of the matte shows the same picture. Prints
// the mean and the largest difference of a colour, in 1/255 of sRGB, and fails where a mean is above 2.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { open_browser } from "./browser.mjs";
import { difference, monitors_of } from "./mattes.mjs";
import { checks, noise, png } from "./pictures.mjs";
import { stand_in } from "./stand_in.mjs";

const kMostMean = 2;

const [glasswing, matte, ...given] = process.argv.slice(2);
if (matte === undefined) {
  console.error("usage: composite_test.mjs GLASSWING MATTE.exr [PICTURE.png]...");
  process.exit(2);
}
const folder = mkdtempSync(join(tmpdir(), "composite-"));
const monitors = monitors_of(matte);

const [first] = monitors;
const made = (name, colour) => {
  const file = join(folder, `${name}.png`);
  writeFileSync(file, png(first.width_px, first.height_px, colour));
  return file;
};
const pictures = [...given, made("checks", checks(1)), made("noise", noise(20261122))];

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
  const compare = async (name, picture, shift) => {
    const [drawn] = await Promise.all([page.waitForEvent("download"), download.click()]);
    const ours = join(folder, "page.png"), theirs = join(folder, "composite.png");
    await drawn.saveAs(ours);
    const behind = monitors.flatMap((monitor) => ["--background", `${monitor.name}=${picture}`]);
    execFileSync(glasswing, ["composite", matte, ...behind, ...shift, "-o", theirs], { stdio: "pipe" });
    const { mean, most, x, y } = await difference(page, ours, theirs);
    failed ||= !(mean <= kMostMean);
    console.log(`${name.padEnd(24)} ${mean.toFixed(3).padStart(8)} ${String(most).padStart(8)} at ${x},${y}`);
  };
  for (const picture of pictures) {
    await show(page, picture);
    await compare(basename(picture), picture, []);
  }
  // An arrow key moves the picture of the monitor chosen last by a fiftieth of it.
  const moved = monitors.at(-1);
  await page.getByRole("application").focus();
  for (const key of ["ArrowRight", "ArrowRight", "ArrowRight", "ArrowUp", "ArrowUp"]) await page.keyboard.press(key);
  const [dx, dy] = [3 * 0.02 * moved.width_px, -2 * 0.02 * moved.height_px];
  await compare("noise, moved by keys", pictures.at(-1), ["--shift", `${moved.name}=${dx},${dy}`]);
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
}
process.exit(failed ? 1 : 0);
