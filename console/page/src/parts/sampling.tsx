import { samplingOf, type MatteMetadata } from "../light/matte";

/** Says so where a large matte's pixels are not all shown. */
export function Sampling({ metadata }: { metadata: MatteMetadata }) {
  const step = samplingOf(metadata);
  if (step === 1) return null;
  return (
    <p class="note">
      Of {step} × {step} pixels one is shown. The downloaded matte has all of them.
    </p>
  );
}
