// How coarse a picture is while it moves, on graphics processors that are too slow for all of its pixels.

const kSlow_ms = 60;
const kCoarsest = 8;
const kMinSide_px = 160;

export class Pace {
  private whole_ms = 0;

  /** `side_px`: the picture's longer one, which stays worth looking at. */
  constructor(private readonly side_px: number) {}

  /** Every so many pixels along both sides are drawn while something moves. */
  get step(): number {
    let step = 1;
    while (
      step < kCoarsest &&
      this.side_px >= 2 * step * kMinSide_px &&
      this.whole_ms > kSlow_ms * step * step
    )
      step *= 2;
    return step;
  }

  /** A coarse picture tells of slowness alone: below a refresh nothing can be timed. */
  took(step: number, time_ms: number): void {
    const whole_ms = time_ms * step * step;
    if (step === 1 || time_ms > 2 * kSlow_ms)
      this.whole_ms = step === 1 ? whole_ms : Math.max(this.whole_ms, whole_ms);
  }
}
