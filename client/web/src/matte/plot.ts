// The chart library and its style, loaded when a chart is first drawn.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

export { uPlot };
