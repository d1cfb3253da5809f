import { defineConfig } from "vite";

// The player of folders for the web: any server shows them, at any address.
export default defineConfig({
  root: "player",
  base: "./",
  build: { target: "es2023", assetsInlineLimit: 0, modulePreload: { polyfill: false } },
});
