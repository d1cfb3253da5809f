import type { PageProps } from "../pages";
import { List } from "./list";
import { NewSession } from "./new_session";
import { One } from "./one";
import "./session.css";

export default function Page({ path: [name] }: PageProps) {
  if (name === undefined) return <List />;
  return name === "+new" ? <NewSession /> : <One name={name} />; // no session's name has a plus
}
