// A session of 2,000 steps with more than 10,000 events that arrive while it is open: the page must stay responsive.
//
//   node tests/browser/timeline_test.mjs
//
// Prints the longest time that the page was blocked, and fails if people would notice it.
import { strict as assert } from "node:assert";
import { join } from "node:path";
import { open_browser } from "./browser.mjs";
import { stand_in } from "./stand_in.mjs";

const kSteps = 2000,
  kFailing = 0.8; // probability that a first showing fails
const kMax_ms = 200; // longest time that the page may be blocked

/** Each step is shown, may fail, and is finally proven. */
function all_events() {
  const events = [];
  let seconds = 0;
  for (
    let pending = Array.from({ length: kSteps }, (_, step) => step), round = 0;
    pending.length > 0;
    ++round
  ) {
    const again = [];
    for (const step of pending) {
      events.push({ step, outcome: "STEP_OUTCOME_SHOWN", seconds: (seconds += 1 / 30) });
      if ((step * 7 + round * 3) % 5 < 5 * kFailing && round < 4) {
        events.push({
          step,
          outcome: "STEP_OUTCOME_RETAKEN",
          seconds,
          why: "its frame's pixels showed another id",
        });
        again.push(step);
      } else {
        events.push({
          step,
          outcome: "STEP_OUTCOME_PROVEN",
          seconds,
          file: `frames/${step}.tif`,
          proof: "PROOF_TIME_AND_PATCH",
        });
      }
    }
    pending = again;
  }
  return events;
}

const events = all_events();
const kNow = Math.floor(events.length / 2); // events present when the page is opened; the rest arrive in small batches
const session = {
  name: "long",
  state: "SESSION_STATE_CAPTURING",
  stepCount: kSteps,
  plan: {},
  method: "gaussian",
  created: "2026-11-22T12:00:00Z",
};

async function* stream_of(path) {
  if (path.endsWith("/WatchSession")) {
    for (let proven = 0; ; proven += 7) {
      yield { session: { ...session, provenCount: Math.min(proven, kSteps) } };
      await new Promise((resolve) => setTimeout(resolve, 100));
    }
  }
  for (let i = 0; i < kNow; i += 1000) yield { events: events.slice(i, Math.min(kNow, i + 1000)) };
  for (let i = kNow; i < events.length; i += 20) {
    yield { events: events.slice(i, i + 20) };
    await new Promise((resolve) => setTimeout(resolve, 5));
  }
  await new Promise(() => undefined); // the capture goes on
}

const server = await stand_in({
  stream: (path) => (/\/Watch(Session|Steps)$/.test(path) ? stream_of(path) : undefined),
});
const browser = await open_browser();
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  await page.addInitScript(() => {
    window.stretches = [];
    new PerformanceObserver((list) =>
      window.stretches.push(...list.getEntries().map(({ duration }) => duration)),
    ).observe({ type: "longtask", buffered: true });
  });
  await page.goto(`${server.url}/#/session/long`);
  const began = Date.now();
  await page.locator(".keys", { hasText: "2,000 proven by time and id patch" }).waitFor();
  assert.ok(events.length > 10_000);
  console.log(`${events.length} events of ${kSteps} steps in ${((Date.now() - began) / 1000).toFixed(1)} s`);
  const retaken = events.filter(({ outcome }) => outcome === "STEP_OUTCOME_RETAKEN").length;
  assert.ok(
    (await page.locator(".keys").textContent()).includes(`${retaken.toLocaleString("en")} times shown again`),
  );
  const stretches = await page.evaluate(() => window.stretches);
  const longest = Math.max(0, ...stretches);
  console.log(
    `longest stretch in which the page answers nothing: ${longest.toFixed(0)} ms (${stretches.length} above 50 ms)`,
  );
  console.log(`elements on the page: ${await page.evaluate(() => document.querySelectorAll("*").length)}`);
  if (process.env.GLASSWING_PICTURES)
    await page.screenshot({ path: join(process.env.GLASSWING_PICTURES, "timeline.png"), fullPage: true });
  assert.ok(longest <= kMax_ms, `the page was busy for ${longest} ms; ${kMax_ms} are allowed`);
} finally {
  await browser.close();
  server.close();
}
