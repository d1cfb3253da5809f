import { useState } from "preact/hooks";
import type { ListSessionsResponseJson } from "../gen/glasswing/v1/session_service_pb";
import { polled, useFeed } from "../parts/feed";
import { FeedFailure } from "../parts/silence";
import { kNewestFirst, ordered } from "../session/order";
import { SessionTable } from "../session/session_table";
import "../session/session.css";
import { isCalibration } from "../session/states";
import { Calibrations } from "./calibrations";
import "./rig.css";

/** What the rig's devices were measured to do, and the captures that measured it. */
export default function Page() {
  const [order, setOrder] = useState(kNewestFirst);
  const { value, live, error } = useFeed(
    (signal) => polled<ListSessionsResponseJson>("SessionService/ListSessions", {}, 2, { signal }),
    [],
  );
  const captured = ordered((value?.sessions ?? []).filter(isCalibration), order);
  return (
    <div class="rig">
      <h1>Calibrations</h1>
      <Calibrations />
      {!live && <FeedFailure error={error} />}
      {captured.length > 0 && (
        <section class={live ? "card" : "card stale"}>
          <h2>Captures that measured them</h2>
          <SessionTable sessions={captured} order={order} setOrder={setOrder} pictured={false} />
        </section>
      )}
    </div>
  );
}
