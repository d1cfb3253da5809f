#include "client/capture/upload.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/cli/camera_argument.h"
#include "client/cli/rig_view.h"
#include "client/plans/photo.h"
#include "core/base/status.h"
#include "core/cli/progress.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

// The monitor that shows the photos: the plan's first.
absl::StatusOr<v1::Monitor> photo_monitor(const v1::Plan& plan, const RigView& rig) {
  if (rig.monitors.empty()) return absl::UnavailableError("no display node is up; start glasswing-display");
  if (plan.monitors().empty()) return rig.monitors.front();
  for (const v1::Monitor& monitor : rig.monitors) {
    if (monitor.name() == plan.monitors(0).name()) return monitor;
  }
  return absl::FailedPreconditionError(
      fmt::format("the plan's monitor \"{}\" is not in the rig; glasswing nodes lists its monitors",
                  plan.monitors(0).name()));
}

absl::StatusOr<std::string> upload(const Peer<v1::SessionService>& server, const RadianceImage& picture) {
  Image16 codes(picture.width_px, picture.height_px);
  std::transform(picture.samples.begin(), picture.samples.end(), codes.samples.begin(), code16_of);
  GW_ASSIGN_OR_RETURN(const std::string png, encode_png16(codes));
  grpc::ClientContext context;
  set_deadline(context, kLongCallTimeout);
  v1::UploadImageResponse stored;
  const auto writer = server.stub->UploadImage(&context, &stored);
  for (size_t at = 0; at < png.size(); at += kChunkBytes) {
    v1::UploadImageRequest request;
    request.set_chunk(png.substr(at, kChunkBytes));
    if (!writer->Write(request)) break;  // Finish() has the reason
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  if (!status.ok()) return status_from(status, server.title);
  return stored.image();
}

}  // namespace

absl::Status upload_photos(const Client& client, const Peer<v1::SessionService>& server,
                           const std::filesystem::path& plan_path, v1::Plan& plan) {
  if (plan.photos().empty()) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const RigView rig, read_rig_view(client, first_camera(plan)));
  GW_ASSIGN_OR_RETURN(const v1::Monitor monitor, photo_monitor(plan, rig));
  Progress progress("uploading photos");
  double sent = 0.0;
  for (v1::Photo& photo : *plan.mutable_photos()) {
    GW_ASSIGN_OR_RETURN(const RadianceImage picture,
                        read_radiance(photo_path(plan_path, photo), Encoding::kDisplay));
    photo.set_name(photo_name(photo));
    GW_ASSIGN_OR_RETURN(*photo.mutable_file(),
                        upload(server, resized(picture, monitor.width_px(), monitor.height_px())));
    progress.update(++sent / plan.photos_size(), photo.name());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> upload_background(const Peer<v1::SessionService>& server,
                                              const std::filesystem::path& file) {
  GW_ASSIGN_OR_RETURN(const RadianceImage picture, read_radiance(file, Encoding::kDisplay));
  const bool fits =
      std::ranges::all_of(picture.samples, [](float light) { return light >= 0.0F && light <= 1.0F; });
  if (fits) return upload(server, picture);
  return absl::InvalidArgumentError(fmt::format(
      "{} has light below 0 or above 1, which the queue does not keep; composite the fetched matte over "
      "it: glasswing composite",
      file.string()));
}

}  // namespace glasswing
