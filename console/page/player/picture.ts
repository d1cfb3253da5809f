// A matte in front of pictures, the same on all monitors.
import { kBuiltIn, openPicture, paint, type BuiltIn } from "../src/play/backgrounds";
import { listenToGestures } from "../src/play/gestures";
import { kStill, Stage } from "../src/play/stage";
import type { MakeShow } from "./show";

export const pictureShow: MakeShow = (canvas, description, matte) => {
  const stage = new Stage(canvas, matte);
  listenToGestures(canvas, {
    get: () => stage.standing(0),
    set: (standing) => stage.monitors.forEach((_, t) => stage.move(t, standing)),
    size: () => stage.monitors[0]!,
  });
  const put = (make: (width: number, height: number) => ImageBitmap): void =>
    stage.monitors.forEach(({ width, height }, t) => {
      stage.move(t, { ...kStill, keepShape: true });
      stage.setPicture(t, make(width, height));
    });
  return {
    offered: description.backgrounds ?? [],
    builtIn: kBuiltIn.filter((kind) => kind !== "colour"),
    choiceLabel: "Picture behind the object",
    ownLabel: "Your picture…",
    canvasLabel:
      "The object in front of a picture. Arrow keys move the picture, plus and minus scale it, 0 puts it back.",
    accept: "image/*",
    open: async (file, name) => {
      const image = await openPicture(file, name, stage.mostPictureSide);
      return () => put(() => image);
    },
    paint: (kind) => put((width, height) => paint(kind as BuiltIn, width, height, "#2f7d8c")),
  };
};
