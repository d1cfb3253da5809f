import { useState } from "preact/hooks";

/** One change at a time: whether it is under way, and how the last one failed. */
export function useAction(): {
  busy: boolean;
  error: unknown;
  act: (change: () => Promise<unknown>) => Promise<boolean>;
} {
  const [busy, setBusy] = useState(false);
  const [error, setError] = useState<unknown>();
  const act = async (change: () => Promise<unknown>): Promise<boolean> => {
    setBusy(true);
    setError(undefined);
    try {
      await change();
      return true;
    } catch (reason) {
      setError(reason);
      return false;
    } finally {
      setBusy(false);
    }
  };
  return { busy, error, act };
}
