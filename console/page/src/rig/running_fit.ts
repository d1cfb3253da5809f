import type { ListCalibrationsResponseJson } from "../gen/glasswing/v1/rig_service_pb";
import { polled, useFeed } from "../parts/feed";

export const kLookAgain_s = 3;

/** Since when a calibration is being fitted to this session (RFC 3339), whoever asked for it; undefined: none is. */
export function useRunningFit(session: string, watch: boolean): string | undefined {
  const { value } = useFeed(
    async function* (signal) {
      if (watch)
        yield* polled<ListCalibrationsResponseJson>("RigService/ListCalibrations", {}, kLookAgain_s, { signal });
    },
    [session, watch],
  );
  return value?.fits?.find((each) => each.session === session)?.since;
}
