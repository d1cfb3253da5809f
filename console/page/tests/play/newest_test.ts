import { describe, expect, it } from "vitest";
import { Newest } from "../../player/newest";

describe("of several things that load", () => {
  it("the last that was asked for is shown, in whatever order they come", async () => {
    const newest = new Newest();
    const seen: string[] = [];
    const arrive: ((name: string) => void)[] = [];
    const shows = [0, 1].map(() =>
      newest.show(
        () => new Promise<string>((resolve) => arrive.push(resolve)),
        (name) => seen.push(name),
      ),
    );
    arrive[1]!("new");
    await shows[1];
    arrive[0]!("old");
    await shows[0];
    expect(seen).toEqual(["new"]);
  });

  it("errors of the last are thrown, of others not", async () => {
    const newest = new Newest();
    const fails = (): Promise<never> => Promise.reject(new Error("cannot be loaded"));
    const old = newest.show(fails, () => undefined);
    const own = newest.show(fails, () => undefined);
    await expect(old).resolves.toBeUndefined();
    await expect(own).rejects.toThrow("cannot be loaded");
  });
});
