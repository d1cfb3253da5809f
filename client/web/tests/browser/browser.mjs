import { chromium } from "playwright-core";

/** Debian's Chromium, headless, with WebGL 2 in software. GLASSWING_CHROMIUM names another. */
export function open_browser() {
  return chromium.launch({
    executablePath: process.env.GLASSWING_CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--no-sandbox",
      "--no-first-run",
      "--disable-quic",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--use-gl=angle",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
    ],
  });
}
