import { useEffect, useRef } from "preact/hooks";
import { colourOf, useDark } from "../parts/colours";

const kInks = ["rgb(220 60 50 / 0.65)", "rgb(40 160 80 / 0.65)", "rgb(60 110 220 / 0.65)"];

/** Three histograms on a square-root scale, so that a few bright pixels remain visible. */
export function Histogram({ counts }: { counts: Uint32Array | undefined }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const dark = useDark();
  useEffect(() => {
    const pen = canvas.current?.getContext("2d");
    if (!pen || !counts) return;
    const { width, height } = pen.canvas;
    pen.clearRect(0, 0, width, height);
    pen.globalCompositeOperation = dark ? "lighter" : "multiply";
    const most = Math.sqrt(Math.max(1, ...counts));
    kInks.forEach((ink, channel) => {
      pen.fillStyle = ink;
      for (let code = 0; code < 256; ++code) {
        const tall = (height - 1) * (Math.sqrt(counts[256 * channel + code]!) / most);
        pen.fillRect(code, height - tall, 1, tall);
      }
    });
    pen.globalCompositeOperation = "source-over";
    pen.fillStyle = colourOf("--line");
    for (const quarter of [64, 128, 192]) pen.fillRect(quarter, 0, 0.5, height);
  }, [counts, dark]);
  return (
    <canvas
      ref={canvas}
      class="histogram"
      width={256}
      height={80}
      role="img"
      aria-label="Histogram of the picture: dark to the left, bright to the right"
    />
  );
}
