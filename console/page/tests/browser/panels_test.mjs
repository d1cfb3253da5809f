// Compares the matte page's panels with those of `glasswing view`:
//
//   node tests/browser/panels_test.mjs GLASSWING MATTE.exr
//
// Both start from the same numbers, so colours may differ only by rounding.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { open_browser } from "./browser.mjs";
import { difference } from "./mattes.mjs";
import { stand_in_of } from "./stand_in.mjs";

const kMax = 1;
const kPanels = ["foreground", "coverage", "modes", "centre", "sigma", "uncertainty", "flags"];

const [glasswing, matte] = process.argv.slice(2);
if (matte === undefined) {
  console.error("usage: panels_test.mjs GLASSWING MATTE.exr");
  process.exit(2);
}
const folder = mkdtempSync(join(tmpdir(), "panels-"));
const server = await stand_in_of(matte);
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
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
}
process.exit(failed ? 1 : 0);
