// Moves a picture with mouse, touch, wheel and keys.
import type { Standing } from "../light/compositor";
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
  const end = new AbortController();
  const options = { signal: end.signal };
  const fingers = new Map<number, { x: number; y: number }>();
  const spread = (): number => {
    const [a, b] = [...fingers.values()];
    return a && b ? Math.max(1, Math.hypot(a.x - b.x, a.y - b.y)) : 1;
  };

  canvas.addEventListener(
    "pointerdown",
    (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    },
    options,
  );
  canvas.addEventListener(
    "pointermove",
    (event) => {
      const finger = fingers.get(event.pointerId);
      if (!finger) return;
      const before = spread();
      // With two fingers, each moves the picture by half.
      const share = picture.size().width / shownWidth(canvas) / fingers.size;
      const [dx, dy] = [(event.clientX - finger.x) * share, (event.clientY - finger.y) * share];
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      const standing = picture.get();
      picture.set(scaled({ ...standing, dx: standing.dx + dx, dy: standing.dy + dy }, spread() / before));
    },
    options,
  );
  const lift = (event: PointerEvent): void => void fingers.delete(event.pointerId);
  canvas.addEventListener("pointerup", lift, options);
  canvas.addEventListener("pointercancel", lift, options);
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const pixels = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 * event.deltaY : event.deltaY;
      picture.set(scaled(picture.get(), Math.exp(-0.0015 * pixels)));
    },
    { ...options, passive: false },
  );
  canvas.addEventListener(
    "keydown",
    (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      const standing = byKey(event, picture.get(), picture.size());
      if (!standing) return;
      event.preventDefault();
      picture.set(standing);
    },
    options,
  );
  return () => end.abort();
}
