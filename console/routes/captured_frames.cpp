#include "console/routes/captured_frames.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/radiometry/frame_light.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kTimeout(30);

// Concatenates the chunks of a stream.
template <typename Response>
absl::StatusOr<std::string> read_all(grpc::ClientReader<Response>& reader, const std::string& peer) {
  std::string bytes;
  for (Response part; reader.Read(&part);) bytes += part.chunk();
  GW_RETURN_IF_ERROR(from_grpc(reader.Finish(), peer));
  return bytes;
}

std::uint16_t sample_at(const std::string& bytes, size_t index) {
  std::uint16_t sample = 0;  // little endian, as this machine
  std::memcpy(&sample, bytes.data() + 2 * index, 2);
  return sample;
}

}  // namespace

CapturedFrames::CapturedFrames(const v1::Session& session, std::shared_ptr<grpc::Channel> node)
    : session_(session.name()),
      peer_("the node at " + session.archive_address() + ", which has the frames,"),
      capturing_(session.state() == v1::SESSION_STATE_CREATED ||
                 session.state() == v1::SESSION_STATE_CAPTURING ||
                 session.state() == v1::SESSION_STATE_PAUSED),
      node_(std::move(node)) {}

absl::StatusOr<CapturedFrames> CapturedFrames::of(const std::string& session, const ServerLink& server,
                                                  const Login& login, const ChannelTo& channel_to) {
  GW_ASSIGN_OR_RETURN(const v1::Session found, server.session(login, session));
  const std::string& address = found.archive_address();
  if (address.empty()) return absl::NotFoundError(fmt::format("session \"{}\" has no frames yet", session));
  return CapturedFrames(found, channel_to(address));
}

absl::StatusOr<std::string> CapturedFrames::file(const std::string& file) const {
  v1::ReadFileRequest request;
  request.set_session(session_);
  request.set_file(file);
  grpc::ClientContext context;
  set_deadline(context, kTimeout);
  return read_all(*v1::ArchiveService::NewStub(node_)->ReadFile(&context, request), peer_);
}

absl::StatusOr<std::string> CapturedFrames::jpeg(const std::string& file, int width_px, double stops) const {
  GW_ASSIGN_OR_RETURN(const std::string bytes, this->file(file));
  GW_ASSIGN_OR_RETURN(const Image16 stored, decode_tiff(bytes));
  std::optional<Mosaic> mosaic;
  if (stored.channels == 1) {
    GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, this->manifest());
    mosaic = mosaic_of(manifest.camera());
  }
  const Image16 frame = interpolated(stored, mosaic);
  RadianceImage light(frame.width_px, frame.height_px);
  const auto gain = static_cast<float>(std::exp2(stops));
  for (size_t i = 0; i < frame.samples.size(); ++i) light.samples[i] = gain * radiance_of(frame.samples[i]);
  if (width_px < frame.width_px)
    light = resized(light, width_px, std::max(1, frame.height_px * width_px / frame.width_px));
  return encode_jpeg(light);
}

absl::StatusOr<std::unique_ptr<ArchiveTar>> CapturedFrames::tar() const {
  if (capturing_) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" is being captured; its archive can be downloaded once that is done", session_));
  }
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, this->manifest());
  return ArchiveTar::open(node_, peer_, std::move(manifest));
}

absl::StatusOr<v1::CaptureManifest> CapturedFrames::manifest() const {
  v1::GetManifestRequest ask;
  ask.set_session(session_);
  v1::GetManifestResponse found;
  grpc::ClientContext context;
  set_deadline(context, kTimeout);
  GW_RETURN_IF_ERROR(
      from_grpc(v1::ArchiveService::NewStub(node_)->GetManifest(&context, ask, &found), peer_));
  return std::move(*found.mutable_manifest());
}

absl::StatusOr<std::string> CapturedFrames::samples_json(int x, int y) const {
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, this->manifest());
  const int width = manifest.camera().width_px(), height = manifest.camera().height_px();
  if (x < 0 || y < 0 || x >= width || y >= height) {
    return absl::OutOfRangeError(
        fmt::format("there is no pixel {},{}; the camera has {}x{}", x, y, width, height));
  }
  v1::ReadRowsRequest request;
  request.set_session(session_);
  for (const v1::Frame& frame : manifest.frames()) request.add_files(frame.file());
  request.set_first_row(y);
  request.set_row_count(1);
  grpc::ClientContext context;
  set_deadline(context, kTimeout);
  GW_ASSIGN_OR_RETURN(const std::string rows,
                      read_all(*v1::ArchiveService::NewStub(node_)->ReadRows(&context, request), peer_));
  GW_ASSIGN_OR_RETURN(const FrameLight light, FrameLight::create(manifest));
  const FrameShape shape = shape_of(manifest.camera());
  const std::optional<Mosaic> mosaic = mosaic_of(manifest.camera());
  const size_t row = shape.row_samples();
  if (rows.size() != 2 * row * static_cast<size_t>(manifest.frames_size()))
    return absl::DataLossError(fmt::format("{} sent too few rows", peer_));
  nlohmann::json samples = nlohmann::json::array();
  for (int i = 0; i < manifest.frames_size(); ++i) {
    nlohmann::json radiance;
    bool saturated = false;
    for (int c = 0; c < 3; ++c) {
      if (mosaic && mosaic->channel(x, y) != c) {
        radiance.push_back(nullptr);
        continue;
      }
      const std::uint16_t sample =
          sample_at(rows, static_cast<size_t>(i) * row + static_cast<size_t>(mosaic ? x : 3 * x + c));
      radiance.push_back(light.light(sample, c));
      saturated = saturated || light.saturated(sample);
    }
    nlohmann::json& each =
        samples.emplace_back(nlohmann::json{{"file", manifest.frames(i).file()}, {"radiance", radiance}});
    if (saturated) each["saturated"] = true;
  }
  return nlohmann::json{{"samples", samples}}.dump();
}

}  // namespace glasswing
