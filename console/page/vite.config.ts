import { defineConfig } from "vitest/config";

// The content security policy forbids inline content, so assets are never inlined. `vite` serves the pages for development and
// forwards calls to the server at GLASSWING_CONSOLE.
const console_url = process.env["GLASSWING_CONSOLE"] ?? "http://127.0.0.1:7480";
// The console compares Host with Origin, which are both those of the development server.
const console_server = { target: console_url, changeOrigin: false };
const passed_on = ["/login", "/logout", "/me", "/api", "/plans", "/images", "/imports", "/geometries", "/rays", "/mattes", "/stmaps", "/archives", "/frames", "/pixels"];

export default defineConfig({
  build: { target: "es2023", assetsInlineLimit: 0, modulePreload: { polyfill: false } },
  worker: { format: "es" },
  server: { proxy: Object.fromEntries(passed_on.map((path) => [path, console_server])) },
  test: { include: ["tests/**/*_test.ts"], testTimeout: 60_000 }, // of a machine that compiles meanwhile
});
