// The pictures of docs/console.md, of a running rig with a solved session, as README's:
//
//   node tests/browser/take_pictures.mjs "$(glasswing console token --name anna)" SESSION BACKGROUND.png DIRECTORY
import { join } from "node:path";
import { open_browser } from "./browser.mjs";

const kPatience_ms = 30_000;
const kPhone = { width: 390, height: 844 };

const [link, session, background, directory] = process.argv.slice(2);
if (directory === undefined) {
  console.error("usage: take_pictures.mjs LINK SESSION BACKGROUND.png DIRECTORY");
  process.exit(2);
}
const browser = await open_browser();
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(kPatience_ms);
  const take = (name) => page.screenshot({ path: join(directory, `${name}.png`), fullPage: true });
  const look = async (hash, sign) => {
    await page.evaluate((to) => (location.hash = to), hash);
    await page.locator(sign).first().waitFor();
  };
  await page.goto(link);
  await page.getByRole("button", { name: /^Log out/ }).waitFor();
  await look("#/rig", ".nodes tbody tr");
  await page.getByLabel("Pattern").selectOption("bars");
  await page.getByRole("button", { name: "Show", exact: true }).click();
  await page.getByRole("button", { name: "Start", exact: true }).click();
  await page.locator(".preview .state.good").waitFor();
  await take("rig");
  await page.setViewportSize(kPhone);
  await take("rig-phone");
  for (let running = 2; running > 0; --running) await page.getByRole("button", { name: "Stop", exact: true }).first().click();
  await page.setViewportSize({ width: 1280, height: 900 });
  await look("#/session/+new", "main .figures");
  await take("new-session");
  await look("#/session", ".thumbnail img");
  await page.waitForFunction(() => [...document.images].every(({ naturalWidth }) => naturalWidth > 0));
  await take("sessions");
  await look(`#/session/${session}`, ".scrubber img");
  await take("session");
  await look(`#/matte/${session}`, ".panels canvas");
  await page.locator("progress").waitFor({ state: "detached" });
  await take("matte");
  await look(`#/play/${session}`, ".stage:visible");
  await page.locator("progress").waitFor({ state: "detached" });
  await page.locator("input[type=file]").setInputFiles(background);
  await page.locator("option[value=file]").waitFor({ state: "attached" });
  await page.waitForFunction(() => document.querySelector("canvas.stage").ariaBusy === "false");
  await take("play");
  await look("#/fleet", "table");
  await take("fleet");
} finally {
  await browser.close();
}
