// Prepares a plan's photos for upload: linear, in the size of their monitor.
import { ask } from "../api";
import type { MonitorJson } from "../gen/glasswing/v1/archive_pb";
import type { PhotoJson, PlanJson } from "../gen/glasswing/v1/plan_pb";
import { linearPng } from "./png16";

const baseOf = (path: string): string => path.slice(path.lastIndexOf("/") + 1);

/** The name of the photo's frame: the plan's, or the file's stem. */
export function photoName({ name, file = "" }: PhotoJson): string {
  return name || baseOf(file).replace(/\.[^.]*$/, "");
}

/** Files of the plan's photos that were not picked yet, compared by file name. */
export function missingPhotos(plan: PlanJson, files: readonly { name: string }[]): string[] {
  return (plan.photos ?? [])
    .map(({ file = "" }) => baseOf(file))
    .filter((wanted) => !files.some(({ name }) => name === wanted));
}

async function upload(file: File, width: number, height: number): Promise<string> {
  const picture = await createImageBitmap(file).catch(() => {
    throw new Error(`${file.name} cannot be read by this browser; PNG, JPEG and WebP can`);
  });
  const pen = new OffscreenCanvas(width, height).getContext("2d")!;
  pen.imageSmoothingQuality = "high";
  pen.drawImage(picture, 0, 0, width, height);
  picture.close();
  const answer = await ask("/images", {
    method: "POST",
    headers: { "Content-Type": "image/png" },
    body: await linearPng(pen.getImageData(0, 0, width, height)),
  });
  return ((await answer.json()) as { image: string }).image;
}

/** Uploads the photos and replaces their file names in the plan. The plan's first monitor shows them. */
export async function withPhotos(
  plan: PlanJson,
  files: readonly File[],
  monitors: readonly MonitorJson[],
): Promise<PlanJson> {
  if (!plan.photos?.length) return plan;
  const wanted = plan.monitors?.[0]?.name;
  const monitor = monitors.find(({ name }) => wanted === undefined || name === wanted);
  if (!monitor) throw new Error(`the plan's monitor "${wanted ?? ""}" is not in the rig`);
  const photos: PhotoJson[] = [];
  for (const photo of plan.photos) {
    const file = files.find(({ name }) => name === baseOf(photo.file ?? ""));
    if (!file) throw new Error(`the picture ${photo.file ?? ""} was not chosen`);
    photos.push({
      name: photoName(photo),
      file: await upload(file, monitor.widthPx ?? 0, monitor.heightPx ?? 0),
    });
  }
  return { ...plan, photos };
}
