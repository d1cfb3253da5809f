// The player of a folder for the web (docs/web.md): a matte, its pictures, and those that visitors drop.
import { checkedDescription, readWebMatte } from "../src/light/web_matte";
import { kBuiltIn, openPicture, paint, type BuiltIn } from "../src/play/backgrounds";
import { listenToGestures } from "../src/play/gestures";
import { kStill, Stage } from "../src/play/stage";
import "./player.css";

const by = <Kind extends HTMLElement>(id: string): Kind => document.getElementById(id) as Kind;
const canvas = by<HTMLCanvasElement>("stage");
const message = by("message");
const controls = by("controls");

function say(text: string): void {
  message.textContent = text;
  message.hidden = text === "";
}
const fail = (error: unknown): void => say(error instanceof Error ? error.message : String(error));

async function got(name: string): Promise<Response> {
  const response = await fetch(name);
  if (!response.ok) throw new Error(`${name} cannot be loaded: the server answers ${response.status}`);
  return response;
}

class Show {
  private readonly monitors: Stage["monitors"];
  constructor(private readonly stage: Stage) {
    this.monitors = stage.monitors;
  }
  /** On all monitors. */
  private picture(make: (width: number, height: number) => ImageBitmap): void {
    this.monitors.forEach(({ width, height }, t) => {
      this.stage.move(t, { ...kStill, keepShape: true });
      this.stage.setPicture(t, make(width, height));
    });
  }
  builtIn(kind: BuiltIn): void {
    this.picture((width, height) => paint(kind, width, height, "#2f7d8c"));
  }
  async file(file: Blob, name: string): Promise<void> {
    const image = await openPicture(file, name, this.stage.mostPictureSide);
    this.picture(() => image);
  }
}

function addControls(show: Show, pictures: string[]): void {
  const choice = document.createElement("select");
  choice.setAttribute("aria-label", "Picture behind the object");
  const names = [...pictures, ...kBuiltIn.filter((kind) => kind !== "colour")];
  for (const name of names) choice.add(new Option(name.replace(/\.[a-z]+$/, ""), name));
  const choose = async (name: string): Promise<void> => {
    canvas.ariaBusy = "true";
    if (pictures.includes(name)) await show.file(await (await got(name)).blob(), name);
    else show.builtIn(name as BuiltIn);
  };
  choice.onchange = () => void choose(choice.value).catch(fail);
  const label = document.createElement("label");
  label.textContent = "Your picture…";
  const own = document.createElement("input");
  own.type = "file";
  own.accept = "image/*";
  own.onchange = () => own.files?.[0] && void show.file(own.files[0], own.files[0].name).catch(fail);
  label.append(own);
  controls.append(choice, label);
  controls.hidden = false;
  void choose(names[0]!).catch(fail);
}

async function begin(): Promise<void> {
  const description = checkedDescription(await (await got("matte.json")).json());
  if (description.title) document.title = description.title;
  const bytes = new Uint8Array(await (await got("matte.bin")).arrayBuffer());
  const stage = new Stage(canvas, await readWebMatte(description, bytes));
  canvas.hidden = false;
  say("");
  listenToGestures(canvas, {
    get: () => stage.standing(0),
    set: (standing) => stage.monitors.forEach((_, t) => stage.move(t, standing)),
    size: () => stage.monitors[0]!,
  });
  canvas.addEventListener("webglcontextlost", () =>
    say("The graphics processor lost this page; reload it."),
  );
  const show = new Show(stage);
  addControls(show, description.backgrounds);
  document.body.ondragover = (event) => (event.preventDefault(), canvas.classList.add("over"));
  document.body.ondragleave = () => canvas.classList.remove("over");
  document.body.ondrop = (event) => {
    event.preventDefault();
    canvas.classList.remove("over");
    const file = event.dataTransfer?.files[0];
    if (file) void show.file(file, file.name).catch(fail);
  };
}

begin().catch(fail);
