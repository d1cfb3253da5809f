import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { ApiError, begin, logout, me, tokenIn } from "./api";
import { Login } from "./login/login";
import { kPages, type PageEntry, type PageProps } from "./pages";
import { Failure } from "./parts/failure";
import { Held } from "./parts/held";
import { Silence } from "./parts/silence";
import { nextTheme, theme } from "./theme";

function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part; // no page has such a name, and the page says so
  }
}

function pathOf(hash: string): string[] {
  if (tokenIn(hash) !== undefined) return [];
  return hash.replace(/^#\/?/, "").split("/").filter(Boolean).map(decoded);
}

const route = signal(pathOf(location.hash));
addEventListener("hashchange", () => (route.value = pathOf(location.hash)));

const kAskAgain_ms = 1000;

/** Logs in at the start and whenever a link with a token is opened; returns the error if it fails. */
function useLogin(): unknown {
  const [error, setError] = useState<unknown>();
  useEffect(() => {
    const look = (): void => {
      const byLink = tokenIn(location.hash) !== undefined;
      setError(undefined);
      begin().catch((reason: unknown) => {
        if (reason instanceof ApiError && reason.code === "UNAVAILABLE")
          return void setTimeout(look, kAskAgain_ms);
        me.value = null;
        if (byLink || !(reason instanceof ApiError && reason.code === "UNAUTHENTICATED")) setError(reason);
      });
    };
    const lookAgain = (): void => void (tokenIn(location.hash) !== undefined && look());
    look();
    addEventListener("hashchange", lookAgain);
    return () => removeEventListener("hashchange", lookAgain);
  }, []);
  return error;
}

// The name by which the browser found the rig's console; rigs have no other.
const kRig = location.host;

function Lazy({ page, path }: { page: PageEntry; path: string[] }) {
  const [loaded, setLoaded] = useState<{ name: string; Page: ComponentType<PageProps> }>();
  const [error, setError] = useState<unknown>();
  useEffect(() => {
    setError(undefined);
    page.load().then((module) => setLoaded({ name: page.name, Page: module.default }), setError);
    document.title = `${page.title} · ${kRig} · Glasswing`;
  }, [page]);
  if (error) return <Failure error={error} />;
  return loaded?.name === page.name ? <loaded.Page path={path} /> : null;
}

function Navigation({ now }: { now: string }) {
  const [open, setOpen] = useState(false); // on narrow screens
  const links = useRef<HTMLElement>(null);
  useEffect(() => {
    const shown = links.current?.querySelector<HTMLElement>("[aria-current]");
    if (shown) links.current!.scrollLeft = shown.offsetLeft - 0.5 * (links.current!.clientWidth - shown.clientWidth);
  }, [now]);
  return (
    <header class="bar">
      <a
        class="skip"
        href="#main"
        onClick={(event) => (event.preventDefault(), document.getElementById("main")?.focus())}
      >
        Skip to the content
      </a>
      <nav ref={links} aria-label="Pages">
        {kPages.map(({ name, title }) => (
          <a key={name} href={`#/${name}`} aria-current={name === now ? "page" : undefined}>
            {title}
          </a>
        ))}
      </nav>
      <span class="spacer" />
      <button
        class="quiet more"
        aria-label="Rig, theme and login"
        aria-expanded={open}
        aria-controls="more"
        onClick={() => setOpen(!open)}
      >
        ⋯
      </button>
      <div id="more" class={open ? "open" : undefined}>
        <b class="rig-name" title="The rig's console">
          {kRig}
        </b>
        <button class="quiet" onClick={nextTheme} title="Light, dark, or the system's">
          Theme: {theme.value}
        </button>
        {me.value && (
          <button
            class="quiet"
            onClick={() => void logout()}
            title={`Logged in as ${me.value.name}, ${me.value.role}`}
          >
            Log out {me.value.name}
          </button>
        )}
      </div>
    </header>
  );
}

export function App() {
  const error = useLogin();
  const [name = kPages[0]!.name, ...path] = route.value;
  const page = kPages.find((each) => each.name === name);
  useEffect(() => void page?.load(), [page]); // preloads while the login is checked
  if (me.value === undefined) return <Silence />;
  return (
    <>
      <Navigation now={name} />
      <Silence />
      <Held />
      <main id="main" tabIndex={-1}>
        {me.value === null ? (
          <Login before={error} />
        ) : page ? (
          <Lazy page={page} path={path} />
        ) : (
          <Failure error={new Error(`there is no page "${name}"; the links above lead to all pages`)} />
        )}
      </main>
    </>
  );
}
