import { render } from "preact";
import "./style.css";
import "./parts/parts.css";
import { App } from "./app";

render(<App />, document.getElementById("app")!);
