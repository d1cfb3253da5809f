#include "console/routes/import_routes.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <filesystem>

#include "console/http/http_host.h"
#include "console/routes/json_bounds.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/frame/archive_json.h"
#include "core/security/roles.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

using httplib::Request;
using httplib::Response;

constexpr std::chrono::minutes kPutTimeout(10);  // for a request's frames

// Frames on their way to the node, in messages of some hundred kB.
class PassingFrames {
 public:
  PassingFrames(const std::shared_ptr<grpc::Channel>& node, std::string session, const std::string& token)
      : session_(std::move(session)), stub_(v1::ArchiveService::NewStub(node)) {
    set_deadline(context_, kPutTimeout);
    writer_ = stub_->PutFrame(&context_, &stored_);
    message_.set_session(session_);
    message_.set_import_token(token);
  }
  ~PassingFrames() {
    if (writer_ == nullptr) return;
    context_.TryCancel();
    (void)writer_->Finish();
  }
  PassingFrames(const PassingFrames&) = delete;
  PassingFrames& operator=(const PassingFrames&) = delete;

  // The body's next bytes; of those after an error nothing is kept.
  void add(std::string_view bytes) {
    while (!bytes.empty() && status_.ok()) status_ = left_ > 0 ? add_pixels(bytes) : add_record(bytes);
  }
  // Errors are those of PutFrame, and INVALID_ARGUMENT: the body is not what put_frames() takes.
  absl::Status finish(const std::string& peer) {
    if (left_ > 0) {
      status_.Update(absl::InvalidArgumentError(fmt::format("the request ends within {}", file_)));
    }
    if (!record_.empty())
      status_.Update(absl::InvalidArgumentError("the request ends within a frame's record"));
    if (!status_.ok() && !is_refused_) return status_;
    writer_->WritesDone();
    return from_grpc(std::exchange(writer_, nullptr)->Finish(), peer);
  }

 private:
  absl::Status add_record(std::string_view& bytes) {
    constexpr size_t kMaxRecord = 64 << 10;
    const size_t end = bytes.find('\n');
    record_ += bytes.substr(0, end);
    if (record_.size() > kMaxRecord) {
      return absl::InvalidArgumentError(
          fmt::format("a frame's record has more than {} bytes on its line", kMaxRecord));
    }
    if (end == std::string_view::npos) {
      bytes = {};
      return absl::OkStatus();
    }
    bytes.remove_prefix(end + 1);
    v1::Frame& frame = *message_.mutable_frame();
    google::protobuf::util::JsonParseOptions options;
    options.ignore_unknown_fields = true;  // its checksum is of the journal's line
    const auto parsed = google::protobuf::util::JsonStringToMessage(record_, &frame, options);
    if (!parsed.ok()) {
      return absl::InvalidArgumentError(
          fmt::format("a frame's record is not the JSON of a Frame: {}", std::string(parsed.message())));
    }
    record_.clear();
    file_ = frame.file();
    left_ = frame.size_bytes();
    if (left_ > 0) return absl::OkStatus();
    return absl::InvalidArgumentError(
        fmt::format("{} is listed with {} bytes; it must have 1 or more", file_, left_));
  }

  absl::Status add_pixels(std::string_view& bytes) {
    constexpr size_t kMessage = 256 << 10;
    const size_t count = std::min({bytes.size(), static_cast<size_t>(left_), kMessage - chunk_.size()});
    chunk_ += bytes.substr(0, count);
    bytes.remove_prefix(count);
    left_ -= static_cast<std::int64_t>(count);
    if (left_ > 0 && chunk_.size() < kMessage) return absl::OkStatus();
    message_.set_chunk(std::exchange(chunk_, {}));
    is_refused_ = !writer_->Write(message_);
    if (is_refused_) return absl::InternalError("the node ended the call");  // finish() has the reason
    message_.Clear();
    return absl::OkStatus();
  }

  const std::string session_;
  const std::unique_ptr<v1::ArchiveService::Stub> stub_;
  grpc::ClientContext context_;
  v1::PutFrameResponse stored_;
  std::unique_ptr<grpc::ClientWriter<v1::PutFrameRequest>> writer_;
  absl::Status status_;
  bool is_refused_ = false;      // by the node, before all was sent
  v1::PutFrameRequest message_;  // the next one, but for its chunk
  std::string record_, chunk_;   // begun
  std::string file_;             // of the last record
  std::int64_t left_ = 0;        // bytes of the frame's file; 0: a record comes next
};

absl::StatusOr<v1::CaptureManifest> own_manifest(const std::string& json) {
  v1::CaptureManifest manifest;
  GW_RETURN_IF_ERROR(check_json_bounds(json));
  absl::Status status = parse_archive_json(json, "manifest.json", &manifest);
  if (status.ok()) status = check_manifest(manifest);
  if (!status.ok()) return absl::InvalidArgumentError(status.message());
  const auto foreign = std::ranges::find_if_not(manifest.frames(), is_stored_frame);
  if (foreign != manifest.frames().end()) {
    return absl::InvalidArgumentError(fmt::format(
        "the frame {} is not a file frames/NAME.tif: only archives that Glasswing wrote can be imported here",
        foreign->file()));
  }
  return manifest;
}

}  // namespace

void ImportRoutes::begin(const Login& login, const Request& request, const std::string& manifest,
                         Response& response) const {
  const auto begun = [&]() -> absl::StatusOr<v1::BeginImportResponse> {
    v1::BeginImportRequest begin;
    GW_ASSIGN_OR_RETURN(*begin.mutable_manifest(), own_manifest(manifest));
    begin.mutable_manifest()->clear_frames();
    begin.set_name(request.matches[1]);
    begin.set_camera(request.get_param_value("camera"));
    v1::BeginImportResponse answer;
    grpc::ClientContext context;
    set_deadline(context, kCallTimeout);
    call_for(login, context);
    GW_RETURN_IF_ERROR(
        from_grpc(v1::SessionService::NewStub(server_.channel())->BeginImport(&context, begin, &answer),
                  server_.title()));
    return answer;
  }();
  if (!begun.ok()) return refuse(response, begun.status());
  std::string json;
  (void)google::protobuf::util::MessageToJsonString(*begun, &json);
  response.set_content(json, "application/json");
}

void ImportRoutes::put_frames(const Login& login, const Request& request,
                              const httplib::ContentReader& content, Response& response) const {
  const std::string session = request.matches[1];
  const absl::Status put = [&]() -> absl::Status {
    GW_RETURN_IF_ERROR(admit("ArchiveService/PutFrame", login.principal.roles, login.principal.title()));
    const std::string token = request.get_header_value(kTokenHeader);
    if (token.empty()) return absl::InvalidArgumentError(fmt::format("the request lacks {}", kTokenHeader));
    GW_ASSIGN_OR_RETURN(const v1::Session begun, server_.session(login, session));
    PassingFrames frames(nodes_.at(begun.archive_address()), session, token);
    const bool whole = content([&](const char* bytes, size_t size) {
      frames.add({bytes, size});
      return true;
    });
    if (!whole) return absl::InvalidArgumentError("the request's body is incomplete");
    return frames.finish("the camera node at " + begun.archive_address());
  }();
  if (!put.ok()) return refuse(response, put);
  response.set_content("{}", "application/json");
}

}  // namespace glasswing
