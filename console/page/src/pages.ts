// The console's pages. Each is loaded when it is first opened.
import type { ComponentType } from "preact";

/** `path`: the address after the page's name. */
export interface PageProps {
  path: string[];
}

export interface PageEntry {
  name: string;
  title: string;
  load: () => Promise<{ default: ComponentType<PageProps> }>;
}

export const kPages: PageEntry[] = [
  { name: "rig", title: "Rig", load: () => import("./rig/page") },
  { name: "session", title: "Sessions", load: () => import("./session/page") },
  { name: "queue", title: "Queue", load: () => import("./queue/page") },
  { name: "calibrations", title: "Calibrations", load: () => import("./rig/calibrations_page") },
  { name: "matte", title: "Matte", load: () => import("./matte/page") },
  { name: "play", title: "Play", load: () => import("./play/page") },
  { name: "rays", title: "Rays", load: () => import("./rays/page") },
  { name: "fleet", title: "Fleet", load: () => import("./fleet/page") },
];
