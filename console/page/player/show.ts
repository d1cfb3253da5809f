import type { Drawable } from "../src/light/compositor";
import type { WebDescription } from "../src/light/web_matte";

/** What the page shows, and the pictures that visitors choose from. */
export interface Show {
  /** In the folder, by their names. */
  offered: string[];
  builtIn: readonly string[];
  choiceLabel: string;
  ownLabel: string;
  canvasLabel: string;
  /** Of a visitor's own file. */
  accept: string;
  /** What it gives shows the file. */
  open: (file: Blob, name: string) => Promise<() => void>;
  paint: (builtIn: string) => void;
}

export type MakeShow = (canvas: HTMLCanvasElement, description: WebDescription, matte: Drawable) => Show;

export async function got(name: string): Promise<Response> {
  const response = await fetch(name);
  if (!response.ok) throw new Error(`${name} cannot be loaded: the server answers ${response.status}`);
  return response;
}
