// The chart library and its style, loaded with the first chart.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

export { uPlot };
