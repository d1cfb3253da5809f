// Compares what the folder of `glasswing web` shows of rays with `glasswing composite --environment`, turned and not:
//
//   node tests/browser/web_environment_test.mjs GLASSWING PLAYER RAYS.exr ENVIRONMENT...
//
// PLAYER is the built player's directory. Prints sizes, the mean difference in 1/255 of sRGB and the PSNR, the time to the first
// picture and the pictures a second while it turns, and fails if a mean exceeds 1, a PSNR is below 40 dB, or another server is
// called. KEEP=DIR keeps the pictures there; LOSSLESS=1 is of clear glass.
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { difference } from "./mattes.mjs";
import { open_folder, pace_of_moves, wait_until_drawn } from "./web_page.mjs";

const [kMaxMean, kMinPsnr_db] = [1, 40];
const [kTurn_deg, kGain, kKeyStep_deg] = [100, 0.75, 3];

const [glasswing, player, rays, ...environments] = process.argv.slice(2);
if (environments.length === 0) {
  console.error("usage: web_environment_test.mjs GLASSWING PLAYER RAYS.exr ENVIRONMENT...");
  process.exit(2);
}
const work = mkdtempSync(join(tmpdir(), "web-environment-"));
const keep = process.env.KEEP;
if (keep) mkdirSync(keep, { recursive: true });
const folder = join(work, "folder");
const run = (...args) => execFileSync(glasswing, args, { stdio: "pipe", encoding: "utf8" });
const offered = environments.flatMap((environment) => ["--environment", environment]);
const clear = process.env.LOSSLESS ? ["--lossless"] : [];
const facing = ["--environment-turn", `${kTurn_deg}`, "--environment-gain", `${kGain}`];
const written = JSON.parse(run("--json", "web", rays, "-o", folder, "--player", player, ...offered, ...facing, ...clear));
console.log(`${written.width_px}x${written.height_px}: ${written.bytes} bytes, ${written.matte_bytes} of them the rays`);
const shown = JSON.parse(readFileSync(join(folder, "matte.json"), "utf8"));

const { page, complaints, close } = await open_folder(folder, { width: shown.width_px, height: shown.height_px });
let failed = false;
try {
  for (const environment of environments) {
    const name = basename(environment).replace(/\.[a-z]+$/, "");
    await page.getByRole("combobox").selectOption({ label: name });
    for (const turn_deg of [kTurn_deg, kTurn_deg + 2 * kKeyStep_deg]) {
      if (turn_deg !== kTurn_deg) {
        await page.locator("#stage").press("ArrowRight");
        await page.locator("#stage").press("ArrowRight");
      }
      await wait_until_drawn(page);
      const [ours, theirs] = [join(work, "page.png"), join(work, "composite.png")];
      const crop = `${shown.width_px}x${shown.height_px}+${shown.x_px}+${shown.y_px}`;
      const turned = ["--environment-turn", `${turn_deg}`, "--environment-gain", `${kGain}`];
      run("composite", rays, "--environment", environment, ...turned, ...clear, "--crop", crop, "-o", theirs);
      await page.screenshot({ path: ours });
      const { mean, most, psnr_db } = await difference(page, ours, theirs);
      console.log(`${name} turned by ${turn_deg}: mean ${mean.toFixed(2)}, largest ${most}, of 255; ${psnr_db.toFixed(1)} dB`);
      failed ||= !(mean <= kMaxMean && psnr_db >= kMinPsnr_db);
      if (keep)
        for (const picture of [ours, theirs]) copyFileSync(picture, join(keep, `${name}_${turn_deg}_${basename(picture)}`));
    }
    await page.locator("#stage").press("0");
  }
  // A visitor's own file is shown as an offered one is.
  const [first] = shown.environments;
  const [ours, again] = [join(work, "page.png"), join(work, "again.png")];
  await page.getByRole("combobox").selectOption({ index: 0 });
  await wait_until_drawn(page);
  await page.screenshot({ path: ours });
  for (const name of ["evening", "room"]) {
    await page.getByRole("combobox").selectOption(name);
    await wait_until_drawn(page);
    if (keep) await page.screenshot({ path: join(keep, `${name}.png`) });
  }
  await page.locator("input[type=file]").setInputFiles(join(folder, first));
  await wait_until_drawn(page);
  await page.screenshot({ path: again });
  if ((await difference(page, ours, again)).most > 0) {
    failed = true;
    console.error(`${first} looks different as a visitor's own file`);
  }
  const { median, best } = await pace_of_moves(page);
  console.log(`${median.toFixed(1)} whole pictures a second while it turns: the median; ${best.toFixed(1)} by the best sixteenth`);
  for (const complaint of complaints) console.error(complaint);
  failed ||= complaints.length > 0;
} finally {
  await close();
  rmSync(work, { recursive: true });
}
process.exit(failed ? 1 : 0);
