// Turns an environment with mouse, touch and keys; plus, minus and the wheel change its light.
import { listenToMoves } from "../parts/pointers";
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
  listenToMoves(canvas, {
    move: (dx) => {
      const facing = environment.get();
      environment.set({ ...facing, turn_deg: facing.turn_deg + (dx / shownWidth(canvas)) * view_deg });
    },
    scale: (factor) => environment.set(brighter(environment.get(), factor)),
    key: (event) => {
      const facing = byKey(event, environment.get(), first);
      if (facing) environment.set(facing);
      return facing !== undefined;
    },
  });
}
