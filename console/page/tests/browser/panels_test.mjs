// Compares the matte page's panels with those of `glasswing view`:
//
//   node tests/browser/panels_test.mjs GLASSWING MATTE.exr [COLUMN,ROW]
//
// Both start from the same numbers, so colours may differ only by rounding. COLUMN,ROW: a pixel with a footprint of any shape:
// the matte has panel "shape" too, and the pixel's light is drawn as `glasswing view --pixel` does. Both integrate
// over the monitor's pixels, by different rules.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { open_browser } from "./browser.mjs";
import { difference, width_of } from "./mattes.mjs";
import { stand_in_of } from "./stand_in.mjs";

const kMax = 1;
const kPanels = ["foreground", "coverage", "modes", "centre", "sigma", "uncertainty", "flags"];

const [glasswing, matte, pixel] = process.argv.slice(2);
if (matte === undefined) {
  console.error("usage: panels_test.mjs GLASSWING MATTE.exr");
  process.exit(2);
}
const folder = mkdtempSync(join(tmpdir(), "panels-"));
const regions = {};
const [column, row] = (pixel ?? "").split(",").map(Number);
if (pixel) {
  kPanels.push("shape");
  const region = `${width_of(matte)}x1+0+${row}`; // as the page asks for it
  regions[region] = join(folder, "row.exr");
  execFileSync(glasswing, ["matte", "crop", matte, region, "-o", regions[region]], { stdio: "pipe" });
}
const server = await stand_in_of(matte, regions);
const browser = await open_browser();
let failed = false;
try {
  const page = await browser.newPage();
  page.on("pageerror", (error) => console.error(error.message));
  await page.goto(`${server.url}/#/matte/it`);
  await page.locator("[data-panel=flags]").waitFor();
  const channel = page.getByRole("combobox", { name: "Channel" });
  if ((await channel.count()) > 0) await channel.selectOption("2");
  console.log(`${basename(matte)}   largest difference, of 255`);
  for (const name of kPanels) {
    const drawn = await page
      .locator(`[data-panel=${name}] .pixels`)
      .evaluate((canvas) => canvas.toDataURL("image/png"));
    const ours = join(folder, "page.png"),
      theirs = join(folder, "view.png");
    writeFileSync(ours, Buffer.from(drawn.split(",")[1], "base64"));
    execFileSync(glasswing, ["view", matte, "--only", name, "--channel", "b", "-o", theirs], {
      stdio: "pipe",
    });
    const { most, x, y } = await difference(page, ours, theirs);
    failed ||= !(most <= kMax);
    console.log(`${name.padEnd(16)} ${most} at ${x},${y}`);
  }
  if (pixel) {
    const { width, height } = await page.locator("[data-panel=shape] .picture").boundingBox();
    const [columns, rows] = await page
      .locator("[data-panel=shape] .pixels")
      .evaluate((canvas) => [canvas.width, canvas.height]);
    const position = { x: ((column + 0.5) / columns) * width, y: ((row + 0.5) / rows) * height };
    await page.locator("[data-panel=shape] .picture").click({ position });
    const light = page.locator(".light");
    await light.waitFor();
    const title = await page.locator(".footprints", { has: light }).locator("figcaption").textContent();
    const [, , left, top] = title.match(/\d+/g).map(Number);
    const whole = join(folder, "view.png");
    execFileSync(glasswing, ["view", matte, "--pixel", pixel, "-o", whole], { stdio: "pipe" });
    const most = await light.evaluate(
      async (canvas, [text, left, top]) => {
        const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
        const image = await createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none" });
        const pen = new OffscreenCanvas(image.width, image.height).getContext("2d");
        pen.drawImage(image, 0, 0);
        const pixels = (pen, x, y) => pen.getImageData(x, y, canvas.width, canvas.height).data;
        const theirs = pixels(pen, left, top);
        return pixels(canvas.getContext("2d"), 0, 0).reduce((far, value, i) => Math.max(far, Math.abs(value - theirs[i])), 0);
      },
      [readFileSync(whole).toString("base64"), left, top],
    );
    failed ||= !(most <= kMax);
    console.log(`pixel ${pixel}      ${most}`);
  }
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
}
process.exit(failed ? 1 : 0);
