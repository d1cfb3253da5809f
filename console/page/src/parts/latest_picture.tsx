import { useEffect, useRef, useState } from "preact/hooks";

/** A picture whose source may change faster than it loads: while one loads, only the newest request is kept. */
export function LatestPicture({ src, alt }: { src: string; alt: string }) {
  const [shown, setShown] = useState<{ src: string; failed: boolean; width: number; height: number }>();
  const wanted = useRef(src);
  const loading = useRef(false);
  wanted.current = src;
  useEffect(() => {
    const load = async (): Promise<void> => {
      if (loading.current) return;
      loading.current = true;
      for (let loaded: string | undefined; loaded !== wanted.current;) {
        loaded = wanted.current;
        const image = new Image();
        image.src = loaded;
        const failed = await image.decode().then(
          () => false,
          () => true,
        );
        setShown({ src: loaded, failed, width: image.naturalWidth, height: image.naturalHeight });
      }
      loading.current = false;
    };
    void load();
  }, [src]);
  if (!shown) return <p class="note">Loading…</p>;
  if (shown.failed && shown.src === src)
    return (
      <p class="note" role="status">
        The frame could not be loaded: is the node that holds it up?
      </p>
    );
  const { width, height } = shown;
  return <img class={shown.src === src ? undefined : "stale"} src={shown.src} alt={alt} width={width} height={height} />;
}
