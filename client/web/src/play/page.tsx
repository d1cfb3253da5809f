import type { PageProps } from "../pages";

export default function Page({ path }: PageProps) {
  return <p>{path.join("/")}</p>;
}
