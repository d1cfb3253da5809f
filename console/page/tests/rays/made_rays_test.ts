import { expect, it } from "vitest";
import { raysPath } from "../../src/rays/made_rays";

const choice = {
  depths: [
    { session: "vase near", pose: "a&b" },
    { session: "far", pose: "far" },
  ] as [{ session: string; pose: string }, { session: string; pose: string }],
  geometry: "",
  lossless: true,
};

it("names sessions and poses as the console reads them", () => {
  const url = new URL(raysPath(choice), "http://rig");
  expect(url.pathname).toBe("/rays");
  expect(Object.fromEntries(url.searchParams)).toEqual({
    near: "vase near",
    near_pose: "a&b",
    far: "far",
    far_pose: "far",
    lossless: "1",
  });
});
it("asks for a file that is as it is, whatever the environment", () => {
  expect(raysPath(choice, true)).not.toContain("lossless");
  expect(raysPath(choice, true)).toMatch(/^\/rays\.exr\?/);
});
