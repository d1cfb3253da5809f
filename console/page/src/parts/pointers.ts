// Mouse, touch, wheel and keys on a canvas that something is moved in.

export interface Moves {
  /** By (dx, dy) CSS px, and two fingers moved apart by `factor`. Each of several fingers has its part of both. */
  move: (dx: number, dy: number, factor: number) => void;
  /** The wheel, as fingers that move apart by `factor`. */
  scale: (factor: number) => void;
  /** A key without Ctrl, Alt or Meta; false where it does nothing. */
  key: (event: KeyboardEvent) => boolean;
}

/** Returns a function that removes the listeners. */
export function listenToMoves(canvas: HTMLCanvasElement, { move, scale, key }: Moves): () => void {
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
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      move((event.clientX - finger.x) / fingers.size, (event.clientY - finger.y) / fingers.size, spread() / before);
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
      scale(Math.exp(-0.0015 * pixels));
    },
    { ...options, passive: false },
  );
  canvas.addEventListener(
    "keydown",
    (event) => {
      if (!event.ctrlKey && !event.altKey && !event.metaKey && key(event)) event.preventDefault();
    },
    options,
  );
  return () => end.abort();
}
