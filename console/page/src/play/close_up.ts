// A part of a large picture that is shown pixel by pixel.
import type { Box } from "../light/matte";

interface Size {
  width: number;
  height: number;
}

/** Fits into kMostPixels. */
const kCloseUp: Size = { width: 1280, height: 960 };

/** The picture is as large as fits into its element, in the middle. */
export function pointAt(element: DOMRectReadOnly, at: { clientX: number; clientY: number }, picture: Size): { x: number; y: number } {
  const scale = Math.min(element.width / picture.width, element.height / picture.height);
  return {
    x: (at.clientX - element.left - 0.5 * (element.width - picture.width * scale)) / scale,
    y: (at.clientY - element.top - 0.5 * (element.height - picture.height * scale)) / scale,
  };
}

/** The region of `picture` around a point of the canvas, which shows the part `view` of it. */
export function closeUp(canvas: HTMLCanvasElement, at: { clientX: number; clientY: number }, view: Box, picture: Size): Box {
  const { x, y } = pointAt(canvas.getBoundingClientRect(), at, view);
  return regionAround(view.x + x, view.y + y, picture);
}

export function middleOf(element: Element): { clientX: number; clientY: number } {
  const { left, top, width, height } = element.getBoundingClientRect();
  return { clientX: left + 0.5 * width, clientY: top + 0.5 * height };
}

/** As large as kCloseUp where the picture is, and within it. */
export function regionAround(x: number, y: number, picture: Size): Box {
  const along = (centre: number, wanted: number, length: number): [number, number] => {
    const size = Math.min(wanted, length);
    return [Math.max(0, Math.min(length - size, Math.round(centre - 0.5 * size))), size];
  };
  const [left, width] = along(x, kCloseUp.width, picture.width);
  const [top, height] = along(y, kCloseUp.height, picture.height);
  return { x: left, y: top, width, height };
}
