// The order of a session's frames on the page.
import type { CaptureManifestJson, FrameJson } from "../gen/glasswing/v1/archive_pb";

/** Sorts by step; frames without a step keep the archive's order, at the end. */
export function framesBySteps({ frames = [] }: CaptureManifestJson): FrameJson[] {
  const place = ({ step = 0 }: FrameJson): number => (step < 0 ? Infinity : step);
  return [...frames].sort((a, b) => (place(a) === place(b) ? 0 : place(a) - place(b)));
}

/** The index of the frame that was exposed last. */
export function newestOf(frames: readonly FrameJson[]): number {
  const begun = frames.map(({ exposureStartNs }) => Number(exposureStartNs ?? 0));
  return begun.reduce((newest, time, i) => (time >= begun[newest]! ? i : newest), 0);
}

/** The frame to show first: the object before a bright solid, if there is one, otherwise the newest. */
export function showpieceOf(frames: readonly FrameJson[]): number {
  const bright = frames.findIndex(
    ({ object, stimulus }) =>
      object && stimulus?.kind === "solid" && (stimulus.colour ?? [1]).some((part) => Number(part) > 0),
  );
  return bright < 0 ? newestOf(frames) : bright;
}

/** The index of a step's frame, or the index at which it would be. */
export function placeOfStep(frames: readonly FrameJson[], wanted: number): number {
  const place = frames.findIndex(({ step = 0 }) => step < 0 || step >= wanted);
  return place < 0 ? frames.length - 1 : place;
}

/** "000017" for "frames/000017.tif", as in addresses. */
export function fileName({ file = "" }: FrameJson): string {
  return file.replace(/^frames\//, "").replace(/\.tif$/, "");
}
