// The player of a folder for the web (docs/web.md): a matte before pictures, or rays in environments; and files that
// visitors drop.
import { checkedDescription, readWebMatte } from "../src/light/web_matte";
import { surroundedShow } from "./environment";
import { pictureShow } from "./picture";
import { Newest } from "./newest";
import "./player.css";
import { got, type Show } from "./show";

const by = <Kind extends HTMLElement>(id: string): Kind => document.getElementById(id) as Kind;
const canvas = by<HTMLCanvasElement>("stage");
const message = by("message");
const controls = by("controls");

function say(text: string): void {
  message.textContent = text;
  message.hidden = text === "";
}
const fail = (error: unknown): void => say(error instanceof Error ? error.message : String(error));

function addControls(show: Show): void {
  const choice = document.createElement("select");
  choice.setAttribute("aria-label", show.choiceLabel);
  for (const name of [...show.offered, ...show.builtIn]) choice.add(new Option(name.replace(/\.[a-z]+$/, ""), name));
  const choose = (name: string): void =>
    void put(async () =>
      show.offered.includes(name) ? show.open(await (await got(name)).blob(), name) : () => show.paint(name),
    );
  choice.onchange = () => choose(choice.value);
  const label = document.createElement("label");
  label.textContent = show.ownLabel;
  const own = document.createElement("input");
  own.type = "file";
  own.accept = show.accept;
  own.onchange = () => own.files?.[0] && void open(show, own.files[0]);
  label.append(own);
  controls.append(choice, label);
  controls.hidden = false;
  choose(choice.value);
}

const newest = new Newest();

/** Shows what loads, unless something else is requested meanwhile. */
async function put(load: () => Promise<() => void>): Promise<void> {
  canvas.ariaBusy = "true";
  try {
    await newest.show(load, (show) => (show(), say("")));
  } catch (error) {
    canvas.ariaBusy = "false";
    fail(error);
  }
}

const open = (show: Show, file: File): Promise<void> => put(() => show.open(file, file.name));

async function begin(): Promise<void> {
  const description = checkedDescription(await (await got("matte.json")).json());
  if (description.title) document.title = description.title;
  const bytes = new Uint8Array(await (await got("matte.bin")).arrayBuffer());
  const matte = await readWebMatte(description, bytes);
  const show = (description.environments ? surroundedShow : pictureShow)(canvas, description, matte);
  canvas.setAttribute("aria-label", show.canvasLabel);
  canvas.hidden = false;
  say("");
  canvas.addEventListener("webglcontextlost", () =>
    say("The graphics processor lost this page's context; reload the page."),
  );
  addControls(show);
  document.body.ondragover = (event) => (event.preventDefault(), canvas.classList.add("over"));
  document.body.ondragleave = () => canvas.classList.remove("over");
  document.body.ondrop = (event) => {
    event.preventDefault();
    canvas.classList.remove("over");
    const file = event.dataTransfer?.files[0];
    if (file) void open(show, file);
  };
}

begin().catch(fail);
