// Rays in an environment that visitors can turn.
import {
  kBuiltInEnvironments,
  openEnvironment,
  paintEnvironment,
  type BuiltInEnvironment,
} from "../src/play/environments";
import { Scene } from "../src/play/scene";
import { listenToTurns } from "../src/play/turning";
import type { MakeShow } from "./show";

export const surroundedShow: MakeShow = (canvas, description, rays) => {
  const { environments = [], turn_deg = 0, gain = 1, view_deg = 60 } = description;
  const scene = new Scene(canvas, rays, { turn_deg, gain });
  listenToTurns(canvas, view_deg, {
    get: () => scene.facing,
    set: (facing) => (scene.facing = facing),
  });
  return {
    offered: environments,
    builtIn: kBuiltInEnvironments,
    choiceLabel: "Environment of the object",
    ownLabel: "Your environment…",
    canvasLabel:
      "The object in an environment. Left and right arrow keys turn it, plus and minus change its light, 0 puts it back.",
    accept: "image/*,.hdr,.exr",
    open: async (file, name) => {
      const environment = await openEnvironment(file, name, scene.mostPictureSide);
      return () => scene.setEnvironment(environment);
    },
    paint: (kind) => scene.setEnvironment(paintEnvironment(kind as BuiltInEnvironment)),
  };
};
