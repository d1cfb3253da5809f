// Compares the page's composites with those of `glasswing composite`, picture by picture:
//
//   node tests/browser/composite_test.mjs GLASSWING MATTE.exr [PICTURE.png]...
//
// Besides the given pictures it uses one-pixel checks and noise. Every monitor of the matte shows the same picture. Prints the
// mean and the largest colour difference in 1/255 of sRGB, and fails if a mean exceeds 2.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { drop_file, open_browser } from "./browser.mjs";
import { difference, monitors_of } from "./mattes.mjs";
import { checks, noise, png } from "./pictures.mjs";
import { stand_in_of } from "./stand_in.mjs";

const kMaxMean = 2;

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
const random = noise(20261122);
const pictures = [...given, made("checks", checks(1)), made("noise", random)];

async function show(page, picture, put) {
  for (const [t] of monitors.entries()) {
    if (monitors.length > 1) await page.getByLabel("Monitor").selectOption(String(t));
    await put(picture);
    await page.locator("option[value=file]", { hasText: basename(picture) }).waitFor({ state: "attached" });
  }
}

const server = await stand_in_of(matte);
const browser = await open_browser();
let failed = false,
  worst_mean = 0;
try {
  const page = await browser.newPage();
  page.on("console", (message) => {
    if (message.type() !== "error") return;
    console.error(message.text()); // what the content security policy refuses is one
    failed = true;
  });
  page.on("pageerror", (error) => console.error(error.message));
  await page.goto(`${server.url}/#/play/it`);
  const download = page.getByRole("button", { name: "Download frame" });
  await download.waitFor();
  const crop = page.getByLabel("Crop the id patch"); // "composite" has the whole picture
  if ((await crop.count()) > 0) await crop.uncheck();
  console.log(`${basename(matte)}                mean  largest, of 255`);
  /** `shift`: shares of its sides by which the first monitor's picture has moved. */
  const compare = async (name, picture, shift = [0, 0]) => {
    const [drawn] = await Promise.all([page.waitForEvent("download"), download.click()]);
    const ours = join(folder, "page.png"),
      theirs = join(folder, "composite.png");
    await drawn.saveAs(ours);
    const behind = monitors.flatMap((monitor) => ["--background", `${monitor.name}=${picture}`]);
    const moved = `${first.name}=${shift[0] * first.width_px},${shift[1] * first.height_px}`;
    execFileSync(glasswing, ["composite", matte, "--fill", ...behind, "--shift", moved, "-o", theirs], { stdio: "pipe" });
    const { mean, most, x, y } = await difference(page, ours, theirs);
    failed ||= !(mean <= kMaxMean);
    worst_mean = Math.max(worst_mean, mean);
    console.log(`${name.padEnd(24)} ${mean.toFixed(3).padStart(8)} ${String(most).padStart(8)} at ${x},${y}`);
  };
  for (const picture of pictures) {
    const last = picture === pictures.at(-1);
    await show(page, picture, (file) =>
      last ? drop_file(page.getByRole("application"), file) : page.locator("input[type=file]").setInputFiles(file),
    );
    await compare(basename(picture), picture);
  }
  // An arrow key moves the picture of the chosen monitor by a fiftieth of the monitor; the mouse drags it.
  if (monitors.length > 1) await page.getByLabel("Monitor").selectOption("0");
  const [noisy, stage] = [pictures.at(-1), page.getByRole("application")];
  await stage.focus();
  for (const key of ["ArrowRight", "ArrowRight", "ArrowRight", "ArrowUp", "ArrowUp"])
    await page.keyboard.press(key);
  await compare("noise, moved by keys", noisy, [0.06, -0.04]);
  await stage.press("0");
  const [box, shape] = [
    await stage.boundingBox(),
    await stage.evaluate(({ width, height }) => width / height),
  ];
  const [x, y, far] = [
    box.x + box.width / 2,
    box.y + box.height / 2,
    Math.min(box.width, box.height * shape) / 8,
  ];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x - far / 2, y, { steps: 3 });
  await page.mouse.move(x - far, y, { steps: 3 });
  await page.mouse.up();
  await compare("noise, moved by mouse", noisy, [-1 / 8, 0]);
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
}
const name = "console: canvas against glasswing composite, worst mean"; // a row for tests/bench/run
console.log(JSON.stringify({ name, value: worst_mean, unit: "1/255 of sRGB" }));
process.exit(failed ? 1 : 0);
