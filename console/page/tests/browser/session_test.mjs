// A session from the rig's first page to the finished matte, through the page alone, on its own rig:
//
//   GLASSWING_BIN=build/release/bin GLASSWING_CONSOLE_FILES=console/page/dist node tests/browser/session_test.mjs
//
// The page is compared with the output of `glasswing`. Viewers must find no enabled controls. After the server is killed during a
// capture, the page must show nothing wrong and recover by itself. axe-core must find nothing serious. GLASSWING_PICTURES names a directory for a picture of every page.
import { strict as assert } from "node:assert";
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import axe from "axe-core";
import { drop_file, open_browser } from "./browser.mjs";
import { checks, png } from "./pictures.mjs";
import { phone_faults } from "./phone.mjs";
import { start_rig } from "./rig.mjs";

const kPatience_ms = 60_000; // for a busy machine
const kVisits = 3;
const kMaxBytes = 500_000; // all pages together, without pictures and mattes

const pictures = process.env.GLASSWING_PICTURES;
if (pictures) mkdirSync(pictures, { recursive: true });

const told = (name, value) => console.log(`${name.padEnd(48)} ${value}`);
/** A row for tests/bench/run. */
const row = (name, value, unit) => console.log(JSON.stringify({ name, value, unit }));

async function visit(context, link) {
  const page = await context.newPage();
  page.setDefaultTimeout(kPatience_ms);
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on(
    "console",
    (message) =>
      message.type() === "error" &&
      /Content Security Policy/.test(message.text()) &&
      errors.push(message.text()),
  );
  await page.goto(link);
  await page.getByRole("button", { name: /^Log out/ }).waitFor();
  return { page, errors };
}

/** Navigates within the page, as a link does, and waits for `sign`. */
async function look(page, hash, sign) {
  await page.evaluate((to) => (location.hash = to), hash);
  await page.locator(sign).first().waitFor();
}

async function photograph(page, name) {
  if (pictures) await page.screenshot({ path: join(pictures, `${name}.png`), fullPage: true });
}

const state_of = (page) => page.locator(".session .state").first();
const until_state = (page, state) =>
  page.locator(".session .row .state", { hasText: new RegExp(`^${state}$`) }).waitFor();
/** "225 of 225", in the page's format. */
const proven_on = (page) =>
  page
    .locator(".figures > div", { hasText: "Proven" })
    .locator("dd")
    .evaluate((cell) => cell.firstChild.textContent);
const proven_by_cli = ({ proven_count = 0, step_count = 0 }) => `${proven_count} of ${step_count}`;

// --- the cost of a first visit

const middle = (numbers) => numbers.sort((a, b) => a - b)[Math.floor(numbers.length / 2)];

/** A new context with an empty cache. */
async function first_visit(browser, link) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 } });
  const page = await context.newPage();
  const devtools = await context.newCDPSession(page);
  await devtools.send("Network.enable");
  const kinds = new Map();
  let bytes = 0;
  devtools.on("Network.responseReceived", ({ requestId, type, response }) =>
    kinds.set(requestId, { type, url: response.url }),
  );
  devtools.on("Network.loadingFinished", ({ requestId, encodedDataLength }) => {
    const { type, url } = kinds.get(requestId) ?? {};
    if (type !== "Image" && !/\/(mattes|frames)\//.test(url ?? "")) bytes += encodedDataLength;
  });
  await page.addInitScript(() => {
    new MutationObserver(() => {
      if (window.useful_ms === undefined && document.querySelector(".nodes tbody tr"))
        requestAnimationFrame(() => (window.useful_ms = performance.now()));
    }).observe(document, { childList: true, subtree: true });
  });
  await page.goto(link);
  await page.waitForFunction(
    () => window.useful_ms !== undefined && performance.getEntriesByName("first-contentful-paint").length > 0,
  );
  const { useful_ms, painted_ms } = await page.evaluate(() => ({
    useful_ms: window.useful_ms,
    painted_ms: performance.getEntriesByName("first-contentful-paint")[0].startTime,
  }));
  return { context, page, useful_ms, painted_ms, bytes: () => bytes };
}

async function measure_first_visits(browser, link) {
  const visits = [];
  for (let i = 0; i < kVisits; ++i) {
    visits.push(await first_visit(browser, link));
    if (i > 0) await visits[i - 1].context.close();
  }
  const { page, context, bytes } = visits[kVisits - 1];
  told(
    `first paint, middle of ${kVisits}`,
    `${middle(visits.map(({ painted_ms }) => painted_ms)).toFixed(0)} ms`,
  );
  const useful_ms = middle(visits.map(({ useful_ms }) => useful_ms));
  told("first useful paint, the rig's nodes", `${useful_ms.toFixed(0)} ms`);
  row("console: first useful paint on loopback", Math.round(useful_ms), "ms");
  told("transferred until then, without images", `${(bytes() / 1000).toFixed(0)} kB`);
  for (const [hash, sign] of [
    ["#/session", "table"],
    ["#/session/+new", "form .figures"],
    ["#/session/first", ".scrubber img"],
    ["#/matte/first", ".panels"],
    ["#/play/first", ".stage:visible"],
    ["#/rays", ".ray-choice"],
    ["#/calibrations", "h1"],
    ["#/fleet", "table"],
  ])
    await look(page, hash, sign);
  told("transferred for all pages, without images", `${(bytes() / 1000).toFixed(0)} kB`);
  row("console: transferred for all pages, without images", Math.round(bytes() / 1000), "kB");
  assert.ok(bytes() <= kMaxBytes, `${bytes()} bytes were transferred; ${kMaxBytes} are allowed`);
  await context.close();
}

// --- a session through the page

/** Steps that the estimate counts, of a plan that is made for the rig, of this quality. */
async function steps_on(page, quality) {
  const steps = page.locator("form .figures dd").first();
  if (quality !== undefined) {
    const before = await steps.textContent();
    await page.getByLabel("Quality").selectOption(quality);
    await page.waitForFunction(
      (old) => ![undefined, old].includes(document.querySelector("form .figures dd")?.textContent),
      before,
    );
  }
  return steps.evaluate((cell) => Number(cell.firstChild.textContent.replaceAll(",", "")));
}

async function capture_and_solve(page, rig) {
  await look(page, "#/session/+new", "form .figures");
  await photograph(page, "new-session-made");
  const [steps_made, steps_draft] = [await steps_on(page), await steps_on(page, "draft")];
  assert.ok(steps_draft < steps_made, `a draft takes ${steps_draft} steps, a good plan ${steps_made}`);
  await page.getByRole("combobox", { name: /^Plan/ }).selectOption("quick");
  await page.getByLabel("Name").fill("first");
  await page.getByLabel("Note", { exact: true }).fill("seen from the front");
  await page.getByLabel("Tags").fill("vases glass");
  // The plan is edited by hand: it gets a photo, which is uploaded first.
  await page.getByText("Edit the plan's text").click();
  const text = page.getByLabel("The plan's text");
  await page.waitForFunction((area) => area.value.includes("sweeps"), await text.elementHandle());
  await text.fill(`${await text.inputValue()}\nphotos { file: "checks.png" }\n`);
  const picked = { name: "checks.png", mimeType: "image/png", buffer: png(64, 48, checks(8)) };
  await page.getByLabel("Choose its pictures…").setInputFiles(picked);
  const start = page.locator("button.primary:enabled", { hasText: "Start" });
  await start.waitFor();
  await photograph(page, "new-session");
  await page.getByLabel("Solve it as soon as it is captured").uncheck(); // the captured session is looked at first
  await start.click();
  await page.waitForURL(/#\/session\/first$/);
  await until_state(page, "captured");
  assert.equal(await proven_on(page), proven_by_cli(rig.session("first")));
  await page.locator(".timeline").waitFor();
  await page.locator(".scrubber img").waitFor();
  const { note, tags } = rig.session("first");
  assert.deepEqual([note, tags], ["seen from the front", ["glass", "vases"]]);
  told("captured, by the page and by glasswing", await proven_on(page));

  const steps = rig
    .glasswing("steps", "first")
    .split("\n")
    .filter((line) => line.includes("proven"));
  assert.ok(
    (await page.locator(".keys").textContent()).includes(`${steps.length} proven by time and id patch`),
  );
  // The last frame of all, not of those that the page knew before the capture ended.
  await page.locator(".scrubber .note", { hasText: new RegExp(`^${steps.length} kept$`) }).waitFor();
  const slider = page.getByRole("slider", { name: /^Frame/ });
  await slider.press("Home");
  await page.locator(".facts", { hasText: "back: id patch alone" }).waitFor();
  await slider.press("End");
  await page.locator(".facts", { hasText: "back: photo checks" }).waitFor();
  await page.locator(".screen img:not(.stale)").waitFor();
  await photograph(page, "session");

  await page.getByRole("button", { name: "Solve…" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Solve" }).click();
  await look(page, "#/fleet", ".fleet table");
  await photograph(page, "fleet");
  await look(page, "#/session/first", ".session h1");
  await until_state(page, "done");
  const objects = Number(rig.session("first").object_pixel_count).toLocaleString("en");
  assert.ok((await page.locator(".figures").textContent()).includes(`${objects} pixels`));
  told("solved, pixels of object by both", objects);
}

/** The downloads are what `glasswing` writes. */
async function download_all(page, rig) {
  await look(page, "#/matte/first", ".panels");
  const folder = mkdtempSync(join(tmpdir(), "downloads-"));
  const take = async (name, file) => {
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page.locator(".downloads").getByRole("link", { name }).click(),
    ]);
    await download.saveAs(join(folder, file));
    return download.suggestedFilename();
  };
  const bytes = (file) => readFileSync(join(folder, file));
  assert.equal(await take("the matte", "matte.exr"), "first.exr");
  rig.glasswing("fetch", "first", "-o", join(folder, "fetched.exr"));
  assert.ok(bytes("matte.exr").equals(bytes("fetched.exr")));
  assert.equal(await take("its STMap", "stmap.exr"), "first-stmap-back.exr");
  rig.glasswing("stmap", join(folder, "fetched.exr"), "-o", join(folder, "written.exr"));
  assert.ok(bytes("stmap.exr").equals(bytes("written.exr")));
  assert.equal(await take("the archive", "first.tar"), "first.tar");
  execFileSync("tar", ["-xf", "first.tar"], { cwd: folder });
  rig.glasswing("export", "first", join(folder, "exported"));
  const frames = readdirSync(join(folder, "exported/frames"));
  assert.deepEqual(readdirSync(join(folder, "first/frames")).sort(), frames.sort());
  for (const frame of frames) assert.ok(bytes(`first/frames/${frame}`).equals(bytes(`exported/frames/${frame}`)));
  told("downloaded as glasswing writes them", `matte, STMap, ${frames.length} frames`);
  await import_archive(page, rig, folder);
  rmSync(folder, { recursive: true });
}

/** The downloaded archive, dropped as a tar file, is a session again; a folder without one of its frames is an error. */
async function import_archive(page, rig, folder) {
  await look(page, "#/session", "table");
  await drop_file(page.locator(".session"), join(folder, "first.tar"));
  const dialog = page.getByRole("dialog");
  await dialog.getByLabel("Name").fill("imported");
  await photograph(page, "import");
  await dialog.getByRole("button", { name: "Import" }).click();
  await page.waitForURL(/#\/session\/imported$/);
  await until_state(page, "captured");
  rig.glasswing("export", "imported", join(folder, "again"));
  const frames = readdirSync(join(folder, "exported/frames"));
  assert.deepEqual(readdirSync(join(folder, "again/frames")), frames);
  for (const frame of frames)
    assert.ok(
      readFileSync(join(folder, "again/frames", frame)).equals(readFileSync(join(folder, "exported/frames", frame))),
    );
  rmSync(join(folder, "again/frames", frames[7]));
  await look(page, "#/session", "table");
  await page.getByRole("button", { name: "Import…" }).click();
  await dialog.getByLabel("Choose a folder…").setInputFiles(join(folder, "again"));
  await dialog
    .getByRole("alert")
    .filter({ hasText: `the frame again/frames/${frames[7]} is missing; again/manifest.json lists it` })
    .waitFor();
  await dialog.getByRole("button", { name: "Cancel" }).click();
  told("imported as it was downloaded", `${frames.length} frames`);
}

async function open_matte(page) {
  await page.getByRole("link", { name: "View the matte" }).click();
  await page.locator(".panels").waitFor();
  await photograph(page, "matte");
  assert.equal(await page.getByRole("alert").count(), 0);
  await look(page, "#/play/first", ".stage:visible");
  await page.getByRole("button", { name: "Download frame" }).waitFor();
  await photograph(page, "play");
  assert.equal(await page.getByRole("alert").count(), 0);
}

async function read_rig_view(page, rig) {
  await look(page, "#/rig", ".nodes tbody tr");
  await page.getByRole("button", { name: "Start" }).click();
  await page.locator(".preview .state.good").waitFor();
  await page.getByLabel("Actual size").check();
  const shown = await page.locator(".preview .screen canvas").evaluate((it) => [it.clientWidth, it.width]);
  assert.equal(shown[0], shown[1]);
  await page.getByLabel("Actual size").uncheck();
  const save = page.getByRole("button", { name: "Save this picture" });
  const [saved] = await Promise.all([page.waitForEvent("download"), save.click()]);
  assert.equal(saved.suggestedFilename(), "camera-1.jpg");
  await page.getByLabel("Mark sharp edges").check();
  await page.getByRole("button", { name: "Check", exact: true }).click();
  await page.locator(".doctor b[role=status]").waitFor();
  await page.locator(".clocks .u-over").first().waitFor();
  await page.locator(".preview .figures > div", { hasText: "Gain" }).waitFor();
  await page.getByRole("button", { name: "Log of camera-1" }).click();
  await page.getByRole("dialog").getByText(/^(It has logged no|The newest) warning/).waitFor();
  await page.getByRole("dialog").getByRole("button", { name: "Close" }).click();
  assert.equal(await page.locator(".nodes tbody .state.good").count(), 3);
  // The preview shows the capture's pictures.
  rig.glasswing("capture", rig.plan("quick"), "--session", "seen");
  const mean = page.locator(".preview .figures > div", { hasText: "Mean light" }).locator("dd");
  await page.waitForFunction(
    (cell) => parseFloat(cell.textContent) > 5 && parseFloat(cell.textContent) < 30,
    await mean.elementHandle(),
  );
  await photograph(page, "rig");
  rig.glasswing("watch", "seen");
}

async function hold_and_release(page, rig) {
  await look(page, "#/rig", ".nodes tbody tr");
  await page.getByRole("button", { name: "Hold the rig…" }).click();
  await page.getByRole("dialog").getByLabel("Reason").fill("moving the camera");
  await page.getByRole("dialog").getByRole("button", { name: "Hold" }).click();
  const held = page.locator(".held", { hasText: "You hold the rig: moving the camera" });
  await held.waitFor();
  const capture = () => rig.glasswing("capture", rig.plan("quick"), "--session", "other");
  assert.throws(capture, /the rig is held for "moving the camera", taken by anna \(console\)/);
  await page.reload();
  await held.waitFor();
  await page.locator(".nodes tbody tr").first().waitFor();
  assert.throws(capture, /the rig is held for "moving the camera"/);
  await photograph(page, "rig-held");
  await page.getByRole("button", { name: "Check", exact: true }).click(); // belongs to the hold
  await page.locator(".doctor b[role=status]").waitFor();
  await page.getByRole("button", { name: "Release" }).click();
  await held.waitFor({ state: "detached" });
  await page.getByText("The rig is free.").waitFor();
  told("held over a reload, and released", "moving the camera");
}

async function calibrate(page, rig) {
  await look(page, "#/calibrations", ".curve, .note");
  await page.getByRole("button", { name: "Calibrate the camera…" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Start" }).click();
  await page.locator(".curve polyline").nth(2).waitFor();
  await photograph(page, "calibrations");
  const { cameras } = JSON.parse(rig.glasswing("--json", "calibrate", "list"));
  assert.deepEqual(
    await page.locator(".curve b").allTextContents(),
    cameras.map(({ camera }) => camera),
  );
  await page.getByRole("button", { name: "Calibrate the monitors…" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Start" }).click();
  await page.getByText("monitor back uses linear 16-bit codes").waitFor();
  rig.glasswing("calibrate", "forget", cameras[0].camera);
  told("calibrated, by the page and by glasswing", cameras[0].camera);
}

async function annotate_and_delete(page, rig) {
  await look(page, "#/session/seen", ".annotations");
  await page.getByLabel("Note").fill("only to look at");
  await page.getByRole("button", { name: "Save the note" }).click();
  await page.getByLabel("New tag").fill("trial");
  await page.getByRole("button", { name: "Add" }).click();
  await page.getByRole("button", { name: "Remove the tag trial" }).waitFor();
  const { note, tags } = rig.session("seen");
  assert.deepEqual([note, tags], ["only to look at", ["trial"]]);
  await look(page, "#/session", "table");
  await page.locator(".thumbnail img").nth(1).waitFor();
  await page.getByRole("button", { name: "trial" }).click();
  await page.waitForFunction(() => document.querySelectorAll("tbody tr").length === 1);
  await page.getByLabel("Select seen").check();
  await page.getByRole("button", { name: "Delete 1 session…" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Delete 1 session" }).click();
  await page.getByText("No session matches.").waitFor();
  assert.throws(() => rig.session("seen"));
  assert.equal(rig.session("first").state, "SESSION_STATE_DONE");
  await page.getByRole("button", { name: "trial ×" }).click();
  await page.getByRole("link", { name: "first" }).waitFor();
  told("noted, tagged and deleted, by both", "seen");
}

// --- the server is killed during a capture

async function survive_restart(page, rig) {
  rig.glasswing(
    "capture",
    rig.plan("crystal"),
    "--session",
    "second",
    "--tag",
    "vases",
    "--note",
    "handle to the left",
  );
  await look(page, "#/session/second", ".session h1");
  await page.evaluate(() => (window.not_loaded_again = true));
  await page.waitForFunction(() => Number(document.querySelector(".progress progress")?.value ?? 0) >= 30);
  await photograph(page, "session-capturing");
  rig.kill_server();
  const killed = Date.now();
  await page.locator(".silence").waitFor();
  told("the page says that the server is silent after", `${Date.now() - killed} ms`);
  await page.locator(".session.stale").waitFor();
  await photograph(page, "server-away");
  rig.up();
  const back = Date.now();
  await page.locator(".silence").waitFor({ state: "detached" });
  await until_state(page, "paused");
  told("and shows what is so after its return within", `${Date.now() - back} ms`);
  assert.equal(await page.locator(".session.stale").count(), 0);
  assert.equal(await proven_on(page), proven_by_cli(rig.session("second")));
  await page.getByRole("button", { name: "Resume second" }).click(); // in the reason
  await page.getByLabel("Follow the newest").waitFor();
  await page.getByRole("button", { name: "Pause" }).click();
  await until_state(page, "paused");
  assert.equal(rig.session("second").state, "SESSION_STATE_PAUSED");
  await page.getByRole("button", { name: "Resume", exact: true }).click();
  await until_state(page, "captured");
  assert.equal(await proven_on(page), proven_by_cli(rig.session("second")));
  assert.ok(await page.evaluate(() => window.not_loaded_again), "the page was loaded again");
  told("resumed and captured, by both", await proven_on(page));
}

// --- a draft

/** The play page shows the draft while its session is captured, and takes the finished matte by itself. */
async function play_draft(page, rig) {
  const folder = mkdtempSync(join(tmpdir(), "slow-plan-"));
  const plan = join(folder, "slow.txtpb");
  const slow = readFileSync(rig.plan("crystal"), "utf8").replace(/^hold_refreshes:.*/m, "hold_refreshes: 6");
  writeFileSync(plan, slow);
  rig.glasswing("capture", plan, "--session", "third", "--solve");
  rmSync(folder, { recursive: true });
  await look(page, "#/session/third", ".session h1");
  await page.getByRole("link", { name: "Try backgrounds with the draft" }).click();
  await page.locator(".stage:visible").waitFor();
  const images = /A draft of (\d+) of \d+ images/.exec(await page.locator(".play [role=status]").textContent());
  assert.equal(rig.session("third").state, "SESSION_STATE_CAPTURING");
  assert.ok(Number(images[1]) > 0);
  await photograph(page, "play-draft");
  await page.evaluate(() => (window.not_loaded_again = true));
  await page.getByRole("link", { name: "View the matte" }).waitFor({ timeout: 2 * kPatience_ms });
  assert.equal(rig.session("third").state, "SESSION_STATE_DONE");
  assert.equal(await page.locator(".play .failure").count(), 0);
  assert.ok(await page.evaluate(() => window.not_loaded_again), "the page was loaded again");
  told("played before the last image", `a draft of ${images[1]} images`);
}

// --- accessibility

const kPages = [
  ["rig", "#/rig", ".nodes tbody tr"],
  ["sessions", "#/session", "table"],
  ["new-session", "#/session/+new", "main .figures"],
  ["session", "#/session/second", ".scrubber img"],
  ["calibrations", "#/calibrations", "table.sessions"],
  ["matte", "#/matte/first", ".panels"],
  ["play", "#/play/first", ".stage:visible"],
  ["rays-start", "#/rays", ".ray-choice"],
  ["fleet", "#/fleet", "table"],
  ["queue", "#/queue", "main .card"],
];

async function check_accessible(page) {
  const serious = [];
  for (const colorScheme of ["light", "dark"]) {
    await page.emulateMedia({ colorScheme });
    for (const [name, hash, sign] of kPages) {
      await look(page, hash, sign);
      await page.evaluate(axe.source);
      const { violations } = await page.evaluate(() => window.axe.run());
      for (const { id, impact, nodes } of violations) {
        if (impact === "serious" || impact === "critical")
          serious.push(`${name}, ${colorScheme}: ${id} at ${nodes.map(({ target }) => target).join(" ")}`);
      }
      if (colorScheme === "dark") await photograph(page, `${name}-dark`);
    }
  }
  await page.emulateMedia({ colorScheme: "light" });
  told("serious violations that axe-core finds", serious.length);
  assert.deepEqual(serious, []);
}

async function check_narrow(page) {
  const before = page.viewportSize();
  const faults = [];
  for (const size of [
    { width: 360, height: 740 },
    { width: 390, height: 844 },
  ]) {
    await page.setViewportSize(size);
    for (const [name, hash, sign] of kPages) {
      await look(page, hash, sign);
      if (size.width === 390) await photograph(page, `${name}-phone`);
      for (const fault of await phone_faults(page)) faults.push(`${name}, ${size.width} px: ${fault}`);
    }
  }
  await page.setViewportSize(before);
  told("faults on phones of 360 and 390 px", faults.length);
  assert.deepEqual(faults, []);
}

// --- viewers

const kChanges = [
  ...[
    "CreateSession",
    "BeginImport",
    "FinishImport",
    "PauseSession",
    "ResumeSession",
    "CancelSession",
    "DeleteSession",
    "AnnotateSession",
    "SolveSession",
    "ReplicateSession",
  ].map((name) => `/api/SessionService/${name}`),
  ...["CalibrateSync", "CheckRig", "FitCalibration", "ForgetCalibration", "HoldRig", "ReleaseRig"].map(
    (name) => `/api/RigService/${name}`,
  ),
  "/api/ConsoleService/CreateToken",
  "/images",
  "/imports/vase",
  "/imports/vase/frames",
];

async function check_viewer(browser, rig) {
  const context = await browser.newContext();
  const link = rig.glasswing("console", "token", "--viewer", "--name", "visitor").trim();
  const { page, errors } = await visit(context, link);
  const tried = [];
  page.on(
    "request",
    (request) => kChanges.some((path) => request.url().endsWith(path)) && tried.push(request.url()),
  );
  let clicked = 0;
  for (const [, hash, sign] of kPages) {
    await look(page, hash, hash === "#/session/+new" ? "main p" : sign);
    for (const button of await page.locator("main button:enabled:visible").all()) {
      await button.click({ timeout: 2000 }).catch(() => undefined); // the previous click may have removed it
      ++clicked;
      await page.keyboard.press("Escape"); // a dialog that only shows something
    }
  }
  told("buttons that a viewer clicked, changes asked for", `${clicked}, ${tried.length}`);
  assert.deepEqual(tried, []);
  const statuses = await page.evaluate(
    (paths) =>
      Promise.all(
        paths.map((path) =>
          fetch(path, {
            method: "POST",
            headers: { "X-Glasswing": "console", "Content-Type": "application/json" },
            body: "{}",
          }).then(({ status }) => status),
        ),
      ),
    kChanges,
  );
  assert.deepEqual(
    statuses,
    kChanges.map(() => 403),
  );
  told("changes that the server refuses a viewer", statuses.length);
  assert.deepEqual(errors, []);
  await context.close();
}

async function check_bad_link(browser, rig) {
  const page = await (await browser.newContext()).newPage();
  await page.goto(`${rig.url}#token=0000`);
  await page.getByRole("alert").filter({ hasText: "this is not a token of this server" }).waitFor();
  await page.context().close();
}

const rig = await start_rig();
const browser = await open_browser();
try {
  const link = rig.glasswing("console", "token", "--name", "anna").trim();
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 } });
  const { page, errors } = await visit(context, link);
  await capture_and_solve(page, rig);
  await open_matte(page);
  await download_all(page, rig);
  await hold_and_release(page, rig);
  await read_rig_view(page, rig);
  await annotate_and_delete(page, rig);
  await survive_restart(page, rig);
  await calibrate(page, rig);
  await look(page, "#/session", "table");
  await page.locator(".thumbnail img").nth(1).waitFor();
  await photograph(page, "sessions");
  await check_accessible(page);
  await check_narrow(page);
  await play_draft(page, rig);
  assert.deepEqual(errors, []);
  await context.close();
  await check_viewer(browser, rig);
  await check_bad_link(browser, rig);
  await measure_first_visits(browser, link);
} finally {
  await browser.close();
  rig.down();
}
