/** Chooses one of a video's frames; some may be missing. */
export function FrameSlider({
  frames,
  frame,
  onChange,
}: {
  frames: number[];
  frame: number;
  onChange: (frame: number) => void;
}) {
  const choose = (event: Event): void =>
    onChange(frames[Number((event.currentTarget as HTMLInputElement).value)] ?? frame);
  return (
    <label class="frames">
      Frame
      <input
        type="range"
        min={0}
        max={frames.length - 1}
        step={1}
        value={frames.indexOf(frame)}
        onInput={choose}
      />
      <output class="digits">{frame}</output>
    </label>
  );
}
