import type { PreparationJson } from "../gen/glasswing/v1/node_service_pb";

/** "simulating the scene, 37 %" */
export function preparationText({ what = "preparing", done }: PreparationJson): string {
  return done === undefined ? what : `${what}, ${Math.floor(100 * Number(done))} %`;
}
