// The resolution of a moving picture, on graphics processors that are too slow for full resolution.

const kSlow_ms = 60;
const kCoarsest = 8;
const kMinSide_px = 160;

export class Pace {
  private whole_ms = 0;

  /** `side_px`: the picture's longer side, which limits the coarseness. */
  constructor(private readonly side_px: number) {}

  /** While something moves, every step-th pixel along both sides is drawn. */
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

  /** What follows is drawn at full resolution until its time is known. */
  forget(): void {
    this.whole_ms = 0;
  }

  /** Coarse pictures can only show slowness: times below a refresh cannot be measured. */
  took(step: number, time_ms: number): void {
    const whole_ms = time_ms * step * step;
    if (step === 1 || time_ms > 2 * kSlow_ms)
      this.whole_ms = step === 1 ? whole_ms : Math.max(this.whole_ms, whole_ms);
  }
}
