// The cameras that a new session captures with.
import { useEffect, useState } from "preact/hooks";
import { call } from "../api";
import type { ListNodesResponseJson } from "../gen/glasswing/v1/node_service_pb";
import type { PlanJson } from "../gen/glasswing/v1/plan_pb";

/** The camera nodes that are up; undefined until the server has answered. */
export function useCameras(): readonly string[] | undefined {
  const [cameras, setCameras] = useState<readonly string[]>();
  useEffect(() => {
    call<ListNodesResponseJson>("NodeService/ListNodes").then(
      ({ nodes = [] }) =>
        setCameras(
          nodes.filter(({ kind, up }) => kind === "NODE_KIND_CAMERA" && up).map(({ name = "" }) => name),
        ),
      () => setCameras([]), // the call that needs a camera names the error
    );
  }, []);
  return cameras;
}

/** Those that the plan names. */
export function namedCameras({ camera, cameras = [] }: PlanJson): readonly string[] {
  return camera ? [camera] : cameras;
}

/**
 * The plan with the cameras that its session captures with: of several that are up the chosen ones, by default those
 * that the plan names, or all. A calibration measures one.
 */
export function withCameras(plan: PlanJson, up: readonly string[], chosen?: ReadonlySet<string>): PlanJson {
  if (up.length < 2) return plan;
  if (!chosen && namedCameras(plan).length > 0) return plan;
  const used = chosen ? up.filter((name) => chosen.has(name)) : plan.calibration ? up.slice(0, 1) : up;
  const { camera: _, cameras: __, ...rest } = plan;
  return used.length === 1 ? { ...rest, camera: used[0]! } : { ...rest, cameras: [...used] };
}
