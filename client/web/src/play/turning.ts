// Turns an environment with mouse, touch and keys; plus, minus and the wheel change its light.
import { shownWidth } from "./gestures";

export interface Facing {
  turn_deg: number;
  /** Factor on the environment's light. */
  gain: number;
}

const kKeyStep_deg = 3;
const kKeyGain = 2 ** (1 / 4);
const [kMinGain, kMaxGain] = [2 ** -12, 2 ** 12];

export function byKey(event: { key: string; shiftKey: boolean }, facing: Facing, first: Facing): Facing | undefined {
  const step = event.shiftKey ? 5 * kKeyStep_deg : kKeyStep_deg;
  switch (event.key) {
    case "ArrowLeft":
      return { ...facing, turn_deg: facing.turn_deg - step };
    case "ArrowRight":
      return { ...facing, turn_deg: facing.turn_deg + step };
    case "+":
    case "=":
      return brighter(facing, kKeyGain);
    case "-":
      return brighter(facing, 1 / kKeyGain);
    case "0":
      return first;
    default:
      return undefined;
  }
}

function brighter(facing: Facing, factor: number): Facing {
  return { ...facing, gain: Math.min(kMaxGain, Math.max(kMinGain, facing.gain * factor)) };
}

/** `view_deg`: the angle that the camera sees across. What lies ahead follows the pointer. The key 0 puts `first` back. */
export function listenToTurns(
  canvas: HTMLCanvasElement,
  view_deg: number,
  environment: { get: () => Facing; set: (facing: Facing) => void },
  first = environment.get(),
): void {
  const fingers = new Map<number, number>();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event.clientX);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (before === undefined) return;
    fingers.set(event.pointerId, event.clientX);
    const share = (event.clientX - before) / shownWidth(canvas) / fingers.size;
    const facing = environment.get();
    environment.set({ ...facing, turn_deg: facing.turn_deg + share * view_deg });
  });
  const lift = (event: PointerEvent): void => void fingers.delete(event.pointerId);
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const pixels = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 * event.deltaY : event.deltaY;
      environment.set(brighter(environment.get(), Math.exp(-0.0015 * pixels)));
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const facing = byKey(event, environment.get(), first);
    if (!facing) return;
    event.preventDefault();
    environment.set(facing);
  });
}
