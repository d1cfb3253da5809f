// Moves a picture with mouse, touch, wheel and keys.
import type { Standing } from "../light/compositor";
import { listenToMoves } from "../parts/pointers";
import { kStill } from "./stage";

export interface Movable {
  get: () => Standing;
  set: (standing: Standing) => void;
  /** Of the monitor. */
  size: () => { width: number; height: number };
}

const kMinScale = 0.1;
const kMaxScale = 20;
const kKeyStep = 0.02;
const kKeyZoom = 1.1;

function scaled(standing: Standing, factor: number): Standing {
  const scale = Math.min(kMaxScale, Math.max(kMinScale, standing.scale * factor));
  const real = scale / standing.scale;
  // Scales about the monitor's centre.
  return { ...standing, scale, dx: standing.dx * real, dy: standing.dy * real };
}

function byKey(
  event: KeyboardEvent,
  standing: Standing,
  { width, height }: { width: number; height: number },
): Standing | undefined {
  const step = event.shiftKey ? 5 * kKeyStep : kKeyStep;
  switch (event.key) {
    case "ArrowLeft":
      return { ...standing, dx: standing.dx - step * width };
    case "ArrowRight":
      return { ...standing, dx: standing.dx + step * width };
    case "ArrowUp":
      return { ...standing, dy: standing.dy - step * height };
    case "ArrowDown":
      return { ...standing, dy: standing.dy + step * height };
    case "+":
    case "=":
      return scaled(standing, kKeyZoom);
    case "-":
      return scaled(standing, 1 / kKeyZoom);
    case "0":
      return { ...kStill, keepShape: standing.keepShape };
    default:
      return undefined;
  }
}

/** The canvas keeps its aspect ratio within its element. */
export function shownWidth({ width, height, clientWidth, clientHeight }: HTMLCanvasElement): number {
  return Math.max(1, Math.min(clientWidth, (clientHeight * width) / height));
}

/** Returns a function that removes the listeners. */
export function listenToGestures(canvas: HTMLCanvasElement, picture: Movable): () => void {
  return listenToMoves(canvas, {
    move: (dx, dy, factor) => {
      const share = picture.size().width / shownWidth(canvas);
      const standing = picture.get();
      picture.set(scaled({ ...standing, dx: standing.dx + dx * share, dy: standing.dy + dy * share }, factor));
    },
    scale: (factor) => picture.set(scaled(picture.get(), factor)),
    key: (event) => {
      const standing = byKey(event, picture.get(), picture.size());
      if (standing) picture.set(standing);
      return standing !== undefined;
    },
  });
}
