#include "console/routes/session_routes.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "console/http/http_host.h"
#include "console/routes/fetched_matte.h"
#include "console/routes/scratch_file.h"
#include "core/base/status.h"
#include "core/composite/stmap.h"
#include "core/matte/matte_region.h"
#include "core/service/service.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

using httplib::Request;
using httplib::Response;

constexpr int kMaxWidth_px = 4096;
constexpr double kMaxStops = 16.0;

// A required parameter. INVALID_ARGUMENT: not a number in [low, high].
template <typename Number>
absl::StatusOr<Number> number_of(const Request& request, const char* name, Number low, Number high) {
  const std::string text = request.get_param_value(name);
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size() && number >= low && number <= high)
    return number;
  return absl::InvalidArgumentError(fmt::format("{} is \"{}\"; it must be {} to {}", name, text, low, high));
}
// The same for an optional parameter.
template <typename Number>
absl::StatusOr<Number> number_or(const Request& request, const char* name, Number otherwise, Number low,
                                 Number high) {
  return request.has_param(name) ? number_of<Number>(request, name, low, high) : otherwise;
}

// Of the session in the path, as the parameters `frame`, `partial`, `crop` and `pixels` say.
absl::StatusOr<FetchedMatte> fetched_matte(const ServerLink& server, const Login& login,
                                           const Request& wanted) {
  v1::FetchMatteRequest request;
  request.set_name(wanted.matches[1]);
  request.set_partial(wanted.has_param("partial"));
  if (wanted.has_param("frame")) {
    GW_ASSIGN_OR_RETURN(const int frame, number_of<int>(wanted, "frame", 0, 1 << 20));
    request.set_frame(frame);
  }
  if (wanted.has_param("crop")) {
    GW_ASSIGN_OR_RETURN(const MatteRegion region, parse_region(wanted.get_param_value("crop")));
    request.mutable_region()->set_x_px(region.x_px);
    request.mutable_region()->set_y_px(region.y_px);
    request.mutable_region()->set_width_px(region.width_px);
    request.mutable_region()->set_height_px(region.height_px);
  }
  GW_ASSIGN_OR_RETURN(const auto pixels,
                      number_or<std::int64_t>(wanted, "pixels", 0, 1, std::int64_t{1} << 32));
  request.set_max_pixels(pixels);
  return fetch_matte(server, login, request);
}

// As send_stmap() answers it, which is never whole in memory either.
absl::StatusOr<std::shared_ptr<const MappedFile>> stmap_of(const ServerLink& server, const Login& login,
                                                           const Request& wanted, std::mutex& decoding) {
  GW_ASSIGN_OR_RETURN(const FetchedMatte matte, fetched_matte(server, login, wanted));
  GW_ASSIGN_OR_RETURN(const ScratchFile stmap, ScratchFile::create());
  const std::lock_guard lock(decoding);
  GW_RETURN_IF_ERROR(
      write_stmap(matte.file->bytes(), {.monitor = wanted.get_param_value("monitor")}, stmap.path())
          .status());
  return stmap.map();
}

void send_exr(std::shared_ptr<const MappedFile> file, Response& response) {
  const size_t size = file->bytes().size();
  response.set_content_provider(
      size, "image/x-exr", [file = std::move(file)](size_t offset, size_t length, httplib::DataSink& sink) {
        const std::string_view part = file->bytes().substr(offset, std::min<size_t>(length, 1 << 20));
        return sink.write(part.data(), part.size()) && file->intact();
      });
}

}  // namespace

void SessionRoutes::send_matte(const Login& login, const Request& request, Response& response) const {
  const absl::StatusOr<FetchedMatte> matte = fetched_matte(server_, login, request);
  if (!matte.ok()) return refuse(response, matte.status());
  const std::string tag = fmt::format("\"{}\"", matte->checksum);
  response.set_header("ETag", tag);
  response.headers.erase("Cache-Control");
  response.set_header("Cache-Control", "private, no-cache");
  if (request.get_header_value("If-None-Match") == tag) {
    response.status = 304;
    return;
  }
  send_exr(matte->file, response);
}

void SessionRoutes::send_stmap(const Login& login, const Request& request, Response& response) const {
  const auto stmap = stmap_of(server_, login, request, decoding_);
  if (!stmap.ok()) return refuse(response, stmap.status());
  send_exr(*stmap, response);
}

void SessionRoutes::send_archive(const Login& login, const Request& request, Response& response) const {
  auto tar = [&]() -> absl::StatusOr<std::unique_ptr<ArchiveTar>> {
    GW_ASSIGN_OR_RETURN(const CapturedFrames frames, frames_of(request.matches[1], login));
    return frames.tar();
  }();
  if (!tar.ok()) return refuse(response, tar.status());
  // Shared, since std::function copies. A download that fails is broken off, which browsers report.
  response.set_chunked_content_provider(
      "application/x-tar", [tar = std::shared_ptr<ArchiveTar>(*std::move(tar)),
                            session = request.matches[1].str()](size_t, httplib::DataSink& sink) {
        const absl::StatusOr<std::string> bytes = tar->next();
        if (!bytes.ok())
          spdlog::warn("session={} archive broken off: {}", session, std::string(bytes.status().message()));
        if (!bytes.ok()) return false;
        if (!bytes->empty()) return sink.write(bytes->data(), bytes->size());
        sink.done();
        return true;
      });
}

void SessionRoutes::send_frame(const Login& login, const Request& request, Response& response) const {
  const auto frame = [&]() -> absl::StatusOr<std::string> {
    GW_ASSIGN_OR_RETURN(const int width, number_or<int>(request, "width", kMaxWidth_px, 16, kMaxWidth_px));
    GW_ASSIGN_OR_RETURN(const double stops, number_or<double>(request, "stops", 0.0, -kMaxStops, kMaxStops));
    GW_ASSIGN_OR_RETURN(const CapturedFrames frames, frames_of(request.matches[1], login));
    const std::string file = fmt::format("frames/{}.tif", request.matches[2].str());
    return request.matches[3] == "tif" ? frames.file(file) : frames.jpeg(file, width, stops);
  }();
  if (!frame.ok()) return refuse(response, frame.status());
  response.set_content(*frame, request.matches[3] == "tif" ? "image/tiff" : "image/jpeg");
}

void SessionRoutes::send_samples(const Login& login, const Request& request, Response& response) const {
  const auto json = [&]() -> absl::StatusOr<std::string> {
    GW_ASSIGN_OR_RETURN(const int x, number_of<int>(request, "x", 0, 1 << 20));
    GW_ASSIGN_OR_RETURN(const int y, number_of<int>(request, "y", 0, 1 << 20));
    GW_ASSIGN_OR_RETURN(const CapturedFrames frames, frames_of(request.matches[1], login));
    return frames.samples_json(x, y);
  }();
  if (!json.ok()) return refuse(response, json.status());
  response.set_content(*json, "application/json");
}

void SessionRoutes::store_image(const Login& login, const std::string& png, Response& response) const {
  grpc::ClientContext context;
  set_deadline(context, kCallTimeout);
  call_for(login, context);
  v1::UploadImageResponse stored;
  const auto stub = v1::SessionService::NewStub(server_.channel());
  const auto writer = stub->UploadImage(&context, &stored);
  for (size_t at = 0; at < png.size(); at += kChunkBytes) {
    v1::UploadImageRequest part;
    part.set_chunk(png.substr(at, kChunkBytes));
    if (!writer->Write(part)) break;
  }
  writer->WritesDone();
  if (const absl::Status status = from_grpc(writer->Finish(), server_.title()); !status.ok())
    return refuse(response, status);
  response.set_content(nlohmann::json{{"image", stored.image()}}.dump(), "application/json");
}

absl::StatusOr<CapturedFrames> SessionRoutes::frames_of(const std::string& session,
                                                        const Login& login) const {
  return CapturedFrames::of(session, server_, login,
                            [this](const std::string& address) { return nodes_.at(address); });
}

}  // namespace glasswing
