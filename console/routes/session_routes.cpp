#include "console/routes/session_routes.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "console/http/http_host.h"
#include "core/base/checksum.h"
#include "core/base/status.h"
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

absl::StatusOr<std::string> fetch_matte(const ServerLink& server, const Login& login,
                                        const v1::FetchMatteRequest& request) {
  grpc::ClientContext context;
  set_deadline(context, kCallTimeout);
  call_for(login, context);
  const auto stub = v1::SessionService::NewStub(server.channel());
  const auto reader = stub->FetchMatte(&context, request);
  std::string bytes;
  for (v1::FetchMatteResponse part; reader->Read(&part);) bytes += part.chunk();
  GW_RETURN_IF_ERROR(from_grpc(reader->Finish(), server.title()));
  return bytes;
}

}  // namespace

void SessionRoutes::send_matte(const Login& login, const Request& request, Response& response) const {
  v1::FetchMatteRequest wanted;
  wanted.set_name(request.matches[1]);
  wanted.set_partial(request.has_param("partial"));
  if (request.has_param("frame")) {
    const absl::StatusOr<int> frame = number_of<int>(request, "frame", 0, 1 << 20);
    if (!frame.ok()) return refuse(response, frame.status());
    wanted.set_frame(*frame);
  }
  absl::StatusOr<std::string> bytes = fetch_matte(server_, login, wanted);
  if (!bytes.ok()) return refuse(response, bytes.status());
  const std::string tag = fmt::format("\"{}\"", checksum_of(*bytes));
  response.set_header("ETag", tag);
  response.headers.erase("Cache-Control");
  response.set_header("Cache-Control", "private, no-cache");
  if (request.get_header_value("If-None-Match") == tag) {
    response.status = 304;
    return;
  }
  response.set_content(*std::move(bytes), "image/x-exr");
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
