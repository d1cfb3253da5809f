// A local rig for a test, with the console: the programs of GLASSWING_BIN and the page of GLASSWING_CONSOLE_FILES.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const kRoot = fileURLToPath(new URL("../../../../", import.meta.url));
const kPorts = 4; // server, display, camera, console

function is_free(port) {
  return new Promise((resolve) => {
    const server = createServer().once("error", () => resolve(false));
    server.listen(port, "127.0.0.1", () => server.close(() => resolve(true)));
  });
}

async function free_ports() {
  for (let first = 21000 + (process.pid % 8000); first < 32000; first += kPorts) {
    const free = await Promise.all(Array.from({ length: kPorts }, (_, i) => is_free(first + i)));
    if (free.every(Boolean)) return first;
  }
  throw new Error(`no ${kPorts} ports in a row are free on this machine's loopback`);
}

export async function start_rig() {
  const { GLASSWING_BIN: bin, GLASSWING_CONSOLE_FILES: files } = process.env;
  if (!bin || !files)
    throw new Error(
      "GLASSWING_BIN must name the programs' directory, GLASSWING_CONSOLE_FILES the built page's",
    );
  const port = await free_ports();
  const data = mkdtempSync(join(tmpdir(), "console-rig-"));
  const env = { ...process.env, GLASSWING_CONFIG: "/dev/null", GLASSWING_SERVER: `127.0.0.1:${port}` };
  const run = (program, args) =>
    execFileSync(program, args, { env, encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });
  const local_rig = (verb, ...args) => run(join(kRoot, "deploy/local-rig"), [verb, "--data", data, ...args]);
  const up = () =>
    local_rig("up", "--port", port, "--console", port + 3, "--console-files", files, "--solvers", 1);
  up();
  return {
    up,
    url: `http://127.0.0.1:${port + 3}/`,
    glasswing: (...args) => run(join(bin, "glasswing"), args),
    session: (name) => JSON.parse(run(join(bin, "glasswing"), ["--json", "show", name])),
    matte: (name) => join(data, "server/mattes", `${name}.exr`),
    plan: (name) => join(kRoot, "deploy/plans", `${name}.txtpb`),
    kill_server: () => process.kill(Number(readFileSync(join(data, "run/server.pid"), "utf8")), "SIGKILL"),
    down: () => {
      local_rig("down");
      rmSync(data, { recursive: true });
    },
  };
}
