// Makes rays of two sessions in the console, and compares what it plays with `glasswing rays` and `glasswing composite`:
//
//   GLASSWING_BIN=build/release/bin GLASSWING_CONSOLE_FILES=build/release/page node tests/browser/rays_test.mjs
//
// On a rig of its own, whose two sessions see the same; their poses are assumed. With GLASSWING_DATA also of L_depth, which was
// rendered at two depths. Fails if a played picture is below 40 dB, counts or the file are not those of `glasswing rays`, axe-core
// finds something serious, or an error does not say what is wrong. GLASSWING_PICTURES names a directory for pictures of the page.
import { strict as assert } from "node:assert";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { fileURLToPath } from "node:url";
import axe from "axe-core";
import { drop_file, open_browser } from "./browser.mjs";
import { difference } from "./mattes.mjs";
import { start_rig } from "./rig.mjs";

const kMinPsnr_db = 40;
const kPatience_ms = 60_000; // for a busy machine
const kKeyStep_deg = 3;
const [kLake, kHarbour] = ["lake.jpg", "harbour.png"].map((name) =>
  fileURLToPath(new URL(`../../../../deploy/pictures/${name}`, import.meta.url)),
);

const pictures = process.env.GLASSWING_PICTURES;
if (pictures) mkdirSync(pictures, { recursive: true });
const work = mkdtempSync(join(tmpdir(), "console-rays-"));
const told = (name, value) => console.log(`${name.padEnd(56)} ${value}`);

const camera = (width, height, f, cx, cy, k1) =>
  `camera { width_px: ${width} height_px: ${height} fx_px: ${f} fy_px: ${f} cx_px: ${cx} cy_px: ${cy} k1: ${k1} }\n`;
const pose = (name, pitch, depth) =>
  `monitors { name: "${name}" width_px: 128 height_px: 96 pitch_mm: ${pitch}\n` +
  `  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] translation_mm: [${-64 * pitch}, ${-48 * pitch}, ${depth}] }\n`;

function written(name, text) {
  const file = join(work, name);
  writeFileSync(file, text);
  return file;
}

const wait_until_drawn = (page) =>
  page.waitForFunction(() => document.querySelector(".stage").ariaBusy === "false", undefined, { timeout: kPatience_ms });
const pixels_of = (page, selector) => page.locator(selector).evaluate((canvas) => canvas.toDataURL());

async function photograph(page, name) {
  if (!pictures) return;
  const scheme = await page.evaluate(() => matchMedia("(prefers-color-scheme: dark)").matches);
  await page.screenshot({ path: join(pictures, `${name}${scheme ? "-dark" : ""}.png`), fullPage: true });
}

async function downloaded(page, button, name) {
  const [file] = await Promise.all([page.waitForEvent("download", { timeout: kPatience_ms }), button.click()]);
  const to = join(work, name);
  await file.saveAs(to);
  return to;
}

const kNotSolved = [40, 40, 40]; // in the panel of flags
/** Pixels that are not solved at one of the depths: the page shows them as the nearest that is. */
function not_solved(rig, sessions) {
  const files = sessions.map((session) => {
    const [matte, panel] = ["exr", "png"].map((suffix) => join(work, `${session}-flags.${suffix}`));
    rig.glasswing("fetch", session, "-o", matte);
    rig.glasswing("view", matte, "--only", "flags", "-o", panel);
    return panel;
  });
  return { files, colour: kNotSolved };
}

/** What the page plays against `glasswing composite`. */
async function compare(page, rig, { rays, not }, environment, turn_deg, gain, lossless) {
  await wait_until_drawn(page);
  const ours = await downloaded(page, page.getByRole("button", { name: "Download frame" }), "page.png");
  const theirs = join(work, "composite.png");
  const facing = ["--environment-turn", `${turn_deg}`, "--environment-gain", `${gain}`, ...(lossless ? ["--lossless"] : [])];
  rig.glasswing("composite", rays, "--environment", environment, ...facing, "-o", theirs);
  const { mean, most, psnr_db, count } = await difference(page, ours, theirs, not);
  told(`${basename(environment)} by ${turn_deg} deg, gain ${gain}${lossless ? ", lossless" : ""}`, `mean ${mean.toFixed(2)}, largest ${most}, of 255; ${psnr_db.toFixed(1)} dB of ${count} px`);
  assert.ok(psnr_db >= kMinPsnr_db, `${psnr_db} dB is below ${kMinPsnr_db}`);
}

/** `near` and `far` are sessions; the geometry has poses of these names. */
async function make_and_play(page, rig, near, far, geometry, environments) {
  await page.goto(`${rig.url}#/rays`);
  await page.getByLabel("Geometry").setInputFiles(geometry);
  // Of many sessions two are named as poses, and are chosen already.
  await page.getByRole("combobox", { name: /^Near/ }).selectOption(near);
  await page.getByRole("combobox", { name: /^Far/ }).selectOption(far);
  await page.locator(".rig-view canvas").waitFor();
  await page.getByRole("button", { name: "Make rays" }).click();
  await page.getByRole("button", { name: "Download rays.exr" }).waitFor();
  assert.equal(await page.evaluate(() => location.hash), `#/rays/${near}/${far}`);

  const rays = join(work, "rays.exr");
  const counts = JSON.parse(rig.glasswing("--json", "rays", near, far, "--geometry", geometry, "-o", rays));
  const states = ["matched", "ambiguous", "extrapolated", "unknown"];
  const shown = await page.locator("tr[class^=ray-] [data-label=Rays]").allTextContents();
  assert.deepEqual(shown, states.map((state) => counts[state].toLocaleString("en")));
  const light = states.map((state) => counts[`${state}_light`]);
  const all = light.reduce((sum, each) => sum + each);
  assert.deepEqual(
    await page.locator("tr[class^=ray-] [data-label=Light]").allTextContents(),
    light.map((each) => `${((100 * each) / all).toFixed(1)} %`),
  );
  const file = await downloaded(page, page.getByRole("button", { name: "Download rays.exr" }), "page-rays.exr");
  assert.ok(readFileSync(file).equals(readFileSync(rays)), "the page's file of rays is not that of glasswing rays");
  told(`rays of ${near} and ${far}, as glasswing rays makes them`, shown.join(", "));

  const made = { rays, not: not_solved(rig, [near, far]) };
  const stage = page.locator(".stage");
  for (const [i, environment] of environments.entries()) {
    if (i % 2 === 0) await page.getByLabel("Open an environment…").setInputFiles(environment);
    else await drop_file(page.locator(".stage"), environment);
    await page.locator("option[value=own]", { hasText: basename(environment) }).waitFor({ state: "attached" });
    await stage.press("0");
    await compare(page, rig, made, environment, 0, 1, false);
    for (const key of ["ArrowRight", "ArrowRight", "-", "-", "-", "-"]) await stage.press(key);
    await compare(page, rig, made, environment, 2 * kKeyStep_deg, 0.5, false);
  }
  // The slider turns as the keys do; making again keeps what was chosen.
  const again = async (act) => {
    await Promise.all([page.waitForResponse((response) => response.url().includes("/rays?")), act()]);
    await page.getByRole("button", { name: "Make rays", disabled: false }).waitFor();
  };
  await page.getByRole("slider", { name: "Turn" }).fill("-40");
  await again(() => page.getByLabel("Absorbs nothing").check());
  await compare(page, rig, made, environments.at(-1), -40, 0.5, true);
  await again(() => page.getByLabel("Absorbs nothing").uncheck());
  await wait_until_drawn(page);
}

/** The rig in space moves by keys, buttons and the mouse, and leaves out what is switched off. */
async function look_around(page) {
  const canvas = page.locator(".rig-view canvas");
  const seen = [await pixels_of(page, ".rig-view canvas")];
  const changes = async (what, act) => {
    await act();
    await page.waitForFunction(
      (before) => document.querySelector(".rig-view canvas").toDataURL() !== before,
      seen.at(-1),
    );
    seen.push(await pixels_of(page, ".rig-view canvas"));
    told("the rig in space changes by", what);
  };
  await changes("an arrow key", () => canvas.press("ArrowLeft"));
  await changes("plus", () => canvas.press("+"));
  await changes("the mouse", async () => {
    const { x, y } = await canvas.boundingBox();
    await page.mouse.move(x + 100, y + 100);
    await page.mouse.down();
    await page.mouse.move(x + 160, y + 130, { steps: 3 });
    await page.mouse.up();
  });
  await changes("leaving out what is matched", () => page.getByLabel(/^matched/).uncheck());
  await page.getByLabel(/^matched/).check();
  seen.push(await pixels_of(page, ".rig-view canvas"));
  await changes("From above", () => page.getByRole("button", { name: "From above" }).click());
  await changes("0", () => canvas.press("0"));
  assert.equal(seen.at(-1), seen[0], "0 does not put it back");
}

async function check_errors(page, rig, near, far) {
  const other = written("other.txtpb", camera(128, 104, 200, 64, 52, 0) + pose("front", 1, 200) + pose("back", 1.3, 251.2));
  await page.getByLabel("Geometry").setInputFiles(other);
  await page.getByText(`The geometry has no pose “${near}”`).waitFor();
  assert.ok(await page.getByRole("button", { name: "Make rays" }).isDisabled());
  await page.getByRole("combobox", { name: /^Pose/ }).nth(0).selectOption("front");
  await page.getByRole("combobox", { name: /^Pose/ }).nth(1).selectOption("front");
  await page.getByRole("button", { name: "Make rays" }).click();
  await page.getByRole("alert").filter({ hasText: "they must be more than" }).waitFor();
  await page.getByRole("combobox", { name: /^Pose/ }).nth(1).selectOption("back");
  await page.getByRole("button", { name: "Make rays" }).click();
  await page.getByRole("button", { name: "Download rays.exr" }).waitFor();
  const broken = written("broken.txtpb", "camera {\n  width: 3\n}");
  await drop_file(page.locator(".ray-choice"), broken);
  await page.getByRole("alert").filter({ hasText: "the geometry: line 2" }).waitFor();
  const small = written("small.txtpb", camera(100, 80, 200, 50, 40, 0) + pose(near, 1, 200) + pose(far, 1.3, 251.2));
  await page.getByLabel("Geometry").setInputFiles(small);
  await page.getByRole("button", { name: "Make rays" }).click();
  await page.getByRole("alert").filter({ hasText: "the geometry's camera has 100x80" }).waitFor();
  await page.locator(".ray-choice").scrollIntoViewIfNeeded();
  told("errors name what is wrong", "a pose, the depths, a line, the camera");
}

async function check_accessible(page, name) {
  const serious = [];
  for (const [width, height] of [[1280, 900], [390, 844]]) {
    await page.setViewportSize({ width, height });
    for (const colorScheme of ["dark", "light"]) {
      await page.emulateMedia({ colorScheme });
      await wait_until_drawn(page);
      await page.evaluate(axe.source);
      const { violations } = await page.evaluate(() => window.axe.run());
      for (const { id, impact, nodes } of violations)
        if (impact === "serious" || impact === "critical")
          serious.push(`${width} px, ${colorScheme}: ${id} at ${nodes.map(({ target }) => target).join(" ")}`);
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
      assert.ok(overflow <= 0, `${width} px wide, the page is ${overflow} px wider`);
      await photograph(page, width < 500 ? `${name}-phone` : name);
    }
  }
  await page.setViewportSize({ width: 1280, height: 900 });
  told("serious violations that axe-core finds", serious.length);
  assert.deepEqual(serious, []);
}

const rig = await start_rig();
const browser = await open_browser();
try {
  const link = rig.glasswing("console", "token", "--viewer", "--name", "visitor").trim();
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(kPatience_ms);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => /Content Security Policy/.test(message.text()) && errors.push(message.text()));
  await page.goto(link);
  await page.getByRole("button", { name: /^Log out/ }).waitFor();
  for (const session of ["near", "far"]) {
    rig.glasswing("capture", rig.plan("quick"), "--session", session, "--watch");
    rig.glasswing("solve", session, "--watch");
  }
  // The far monitor's pixels are larger, so rays are not all parallel.
  const assumed = written("assumed.txtpb", camera(128, 104, 200, 64, 52, -0.05) + pose("near", 1, 200) + pose("far", 1.3, 251.2));
  const linear = join(work, "harbour.exr");
  rig.glasswing("convert", kHarbour, linear);
  await make_and_play(page, rig, "near", "far", assumed, [kLake, linear]);
  await look_around(page);
  await check_accessible(page, "rays-crystal");
  await check_errors(page, rig, "near", "far");
  const depths = join(process.env.GLASSWING_DATA ?? "/nonexistent", "rendered/dev2/L_depth");
  if (existsSync(depths)) {
    for (const [session, folder] of [["front", "near"], ["rear", "far"]]) {
      rig.glasswing("import", join(depths, folder), "--session", session);
      rig.glasswing("solve", session, "--method", "gaussian", "--watch");
    }
    const known = written("known.txtpb", camera(160, 120, 250, 81.3, 59.2, -0.06) + pose("front", 1, 200) + pose("rear", 1, 251.2));
    await page.reload();
    await make_and_play(page, rig, "front", "rear", known, [join(depths, "env.exr")]);
    await photograph(page, "rays");
  } else told("L_depth", "is not here; set GLASSWING_DATA");
  assert.deepEqual(errors, []);
} finally {
  await browser.close();
  rig.down();
  if (!process.env.KEEP) rmSync(work, { recursive: true });
}
