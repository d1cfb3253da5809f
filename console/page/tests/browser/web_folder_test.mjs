// Compares what the folder of `glasswing web` shows with `glasswing composite`, picture by picture:
//
//   node tests/browser/web_folder_test.mjs GLASSWING PLAYER MATTE.exr PICTURE.png...
//
// PLAYER is the built player's directory. Pictures have the monitors' shape. Prints sizes, the mean colour difference in 1/255 of
// sRGB, the time to the first picture and the pictures a second while it is dragged, and fails if a mean exceeds 1, that of a
// moving picture 2, or if another server is called.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { difference, monitors_of } from "./mattes.mjs";
import { move_and_return, open_folder, pace_of_moves, wait_until_drawn } from "./web_page.mjs";

const kMaxMean = 1;
const kMaxMovingMean = 2; // as of the page's canvas

const [glasswing, player, matte, ...pictures] = process.argv.slice(2);
if (pictures.length === 0) {
  console.error("usage: web_folder_test.mjs GLASSWING PLAYER MATTE.exr PICTURE.png...");
  process.exit(2);
}
const work = mkdtempSync(join(tmpdir(), "web-folder-"));
const folder = join(work, "folder");
const run = (...args) => execFileSync(glasswing, args, { stdio: "pipe", encoding: "utf8" });
const offered = pictures.flatMap((picture) => ["--background", picture]);
const written = JSON.parse(run("--json", "web", matte, "-o", folder, "--player", player, "--title", "It", ...offered));
run("web", matte, "-o", folder, "--player", player, "--title", "It", ...offered); // takes the place of the first
console.log(`${written.width_px}x${written.height_px}: ${written.bytes} bytes, ${written.matte_bytes} of them the matte`);
const shown = JSON.parse(readFileSync(join(folder, "matte.json"), "utf8"));

// The canvas has one pixel for each of the matte.
const { page, complaints, close } = await open_folder(folder, { width: shown.width_px, height: shown.height_px });
let failed = false;
try {
  if ((await page.title()) !== "It") throw new Error(`the title is ${await page.title()}`);
  for (const picture of pictures) {
    await page.getByRole("combobox").selectOption(basename(picture));
    await wait_until_drawn(page);
    const theirs = join(work, "composite.png"),
      ours = join(work, "page.png");
    const behind = monitors_of(matte).flatMap(({ name }) => ["--background", `${name}=${picture}`]);
    const crop = `${shown.width_px}x${shown.height_px}+${shown.x_px}+${shown.y_px}`;
    run("composite", matte, "--fill", ...behind, "--crop", crop, "-o", theirs);
    const compare = async (name, max_mean) => {
      await page.screenshot({ path: ours });
      const { mean, most, psnr_db } = await difference(page, ours, theirs);
      console.log(`${name.padEnd(20)} mean ${mean.toFixed(2)}, largest ${most}, of 255; ${psnr_db.toFixed(1)} dB`);
      failed ||= !(mean <= max_mean);
    };
    await compare(basename(picture), kMaxMean);
    await move_and_return(page);
    await compare("  while it moves", kMaxMovingMean);
    await page.evaluate(() => window.rest());
    await wait_until_drawn(page);
    await compare("  and rests again", kMaxMean);
  }
  for (const whole of [false, true]) {
    await wait_until_drawn(page); // at rest the page forgets that it was slow
    const { median } = await pace_of_moves(page, whole);
    console.log(`${median.toFixed(1)} ${whole ? "whole " : ""}pictures a second while it is dragged`);
  }
  for (const complaint of complaints) console.error(complaint);
  failed ||= complaints.length > 0;
} finally {
  await close();
  rmSync(work, { recursive: true });
}
process.exit(failed ? 1 : 0);
