// Requests to a camera node: KeepFrames, LearnPatches, LookForPatches, MeasureLight and PutFrame. The input
// is their messages, separated by lines of dashes, as text or in wire format. Whatever they hold, every frame
// that was stored can be read, and the archive's manifest is valid.
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/text_format.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>

#include "camera-node/services/camera_service.h"
#include "core/archive/archive_service.h"
#include "core/base/checksum.h"
#include "core/pattern/id_patch.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

using google::protobuf::TextFormat;

constexpr std::string_view kParting = "\n----\n";
constexpr IdPatch kPatch{.width_px = IdPatch::kMinWidth_px, .first_row = 0, .rows = IdPatch::kMinRows};
constexpr std::int64_t kFrames = 14;

// Shows the ten learning ids of the id patch, then four others.
class FewFrames final : public Camera {
 public:
  v1::GetCameraResponse describe() const override {
    v1::GetCameraResponse response;
    response.mutable_camera()->set_width_px(kPatch.width_px);
    response.mutable_camera()->set_height_px(kPatch.rows);
    response.mutable_camera()->set_bits(12);
    response.set_frame_rate_hz(60.0);
    return response;
  }
  absl::Status start(double) override { return absl::OkStatus(); }
  std::optional<CapturedFrame> next(std::chrono::milliseconds) override {
    if (sequence_ == kFrames) return std::nullopt;
    const auto learning_ids = patch_learning_ids();
    const size_t number = sequence_;
    const auto id =
        number < learning_ids.size() ? learning_ids[number] : static_cast<std::uint16_t>(sequence_);
    CapturedFrame frame;
    frame.taken.set_sequence(++sequence_);
    frame.image = [id] {
      RadianceImage radiance(kPatch.width_px, kPatch.rows);
      kPatch.draw(id, radiance);
      Image16 image(kPatch.width_px, kPatch.rows);
      std::ranges::transform(radiance.samples, image.samples.begin(), code16_of);
      return image;
    };
    return frame;
  }
  void stop() override {}

 private:
  std::int64_t sequence_ = 0;
};

class Node {
 public:
  Node() : cameras_(camera_, store_), archives_(store_) {
    grpc::ServerBuilder builder;
    builder.RegisterService(&cameras_);
    builder.RegisterService(&archives_);
    server_ = builder.BuildAndStart();
    const auto channel = server_->InProcessChannel({});
    frames_ = v1::ArchiveService::NewStub(channel);
    grpc::ClientContext context;
    const auto reader = v1::CameraService::NewStub(channel)->Capture(&context, v1::CaptureRequest());
    v1::CaptureResponse response;
    for (std::int64_t i = 0; i <= kFrames; ++i) FUZZ_CHECK(reader->Read(&response));
    context.TryCancel();
    (void)reader->Finish();
    for (const char* session : {"s", "other"}) create(session);
  }
  ~Node() {
    cameras_.stop();
    server_->Shutdown();
  }

  // Discards what earlier inputs left.
  void forget() {
    v1::KeepFramesRequest request;
    v1::KeepFramesResponse response;
    request.set_session("other");
    FUZZ_CHECK(cameras_.KeepFrames(nullptr, &request, &response).ok());
    if (archive().manifest().frames().empty()) return;
    FUZZ_CHECK(store_.remove("s").ok());
    create("s");
  }
  Archive& archive() { return *store_.find("s").value(); }
  CameraServiceImpl& cameras() { return cameras_; }
  grpc::Status put(const std::vector<v1::PutFrameRequest>& messages) {
    grpc::ClientContext context;
    v1::PutFrameResponse response;
    const auto writer = frames_->PutFrame(&context, &response);
    for (const v1::PutFrameRequest& message : messages) writer->Write(message);
    writer->WritesDone();
    return writer->Finish();
  }

 private:
  void create(const std::string& session) {
    v1::CaptureManifest header;
    header.set_session(session);
    *header.mutable_camera() = camera_.describe().camera();
    header.add_monitors()->set_name("back");
    header.mutable_monitors(0)->set_width_px(32);
    header.mutable_monitors(0)->set_height_px(32);
    FUZZ_CHECK(store_.create(header).ok());
  }

  FewFrames camera_;
  ArchiveStore store_{scratch_directory()};
  CameraServiceImpl cameras_;
  ArchiveServiceImpl archives_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<v1::ArchiveService::Stub> frames_;
};

class Ignored final : public google::protobuf::io::ErrorCollector {
  void AddError(int, int, const std::string&) override {}
};

template <typename Message>
bool parse(const std::string& text, Message& message) {
  TextFormat::Parser parser;
  Ignored ignored;
  parser.RecordErrorsTo(&ignored);
  return parser.ParseFromString(text, &message) || message.ParseFromString(text);
}

void check(const grpc::Status& status) {
  FUZZ_CHECK(status.ok() || !status.error_message().empty());
}

// Sends every message that the text parses as: some share their field numbers.
void ask(Node& node, const std::string& text) {
  v1::KeepFramesRequest keep;
  v1::KeepFramesResponse kept;
  if (parse(text, keep)) check(node.cameras().KeepFrames(nullptr, &keep, &kept));
  v1::LearnPatchesRequest learn;
  v1::LearnPatchesResponse learned;
  if (parse(text, learn)) check(node.cameras().LearnPatches(nullptr, &learn, &learned));
  v1::LookForPatchesRequest look;
  v1::LookForPatchesResponse seen;
  if (parse(text, look)) check(node.cameras().LookForPatches(nullptr, &look, &seen));
  v1::MeasureLightRequest measure;
  v1::MeasureLightResponse light;
  if (parse(text, measure)) check(node.cameras().MeasureLight(nullptr, &measure, &light));
}

std::string put_text(int step, const std::string& file) {
  return "session: \"s\" frame { step: " + std::to_string(step) + " file: \"" + file +
         "\" object: true exposure_ms: 4 checksum: \"@SUM@\" stimulus { kind: \"solid\" panel: \"back\" } }";
}

std::string good_chunk() {
  v1::PutFrameRequest chunk;
  chunk.set_chunk(encode_tiff(Image16(kPatch.width_px, kPatch.rows)));
  return chunk.SerializeAsString();
}

}  // namespace

std::vector<std::string> seeds() {
  const std::string parting(kParting);
  std::string learning = "session: \"s\" accept_unseen_patches: \"left\"\n";
  for (size_t i = 0; i < patch_learning_ids().size(); ++i) {
    learning += "frames { sequence: " + std::to_string(i + 1) + " step: " + std::to_string(i) +
                " exposure_ms: 4 stimulus { kind: \"patch\" panel: \"back\" patch_id: " +
                std::to_string(patch_learning_ids()[i]) + " } }\n";
  }
  const std::string others =
      "session: \"s\" frames { sequence: 11 step: 10 patch_id: 10 }\n"
      "frames { sequence: 12 step: 11 patch_id: 9 exposure_ms: 4 stimulus { kind: \"solid\" panel: \"back\" "
      "} }\n";
  const std::string twice =
      "session: \"s\" frames { sequence: 11 step: 3 } frames { sequence: 12 step: 3 }\n";
  std::vector<std::string> seeds{learning + parting + others, twice,
                                 put_text(-1, "frames/000003.tif") + parting + good_chunk() + parting + twice,
                                 put_text(7, "frames/000003.tif") + parting + good_chunk() + parting + twice,
                                 "sequences: [1, 2, 3, 900] calibration { format_version: 1 }"};
  v1::LearnPatchesRequest learn;
  FUZZ_CHECK(TextFormat::ParseFromString(learning, &learn));
  seeds.push_back(learn.SerializeAsString());
  return seeds;
}

void try_input(std::string_view input) {
  static const google::protobuf::LogSilencer silent;  // about strings that are not UTF-8
  static Node node;
  node.forget();
  std::vector<v1::PutFrameRequest> put;
  std::string bytes;
  const auto send = [&] {
    if (put.empty()) return;
    std::string& sum = *put.front().mutable_frame()->mutable_checksum();
    if (sum == "@SUM@") sum = checksum_of(bytes);
    check(node.put(put));
    put.clear();
    bytes.clear();
  };
  for (size_t end = 0; end != std::string_view::npos;
       input.remove_prefix(std::min(input.size(), end + kParting.size()))) {
    end = input.find(kParting);
    const std::string part(input.substr(0, end));
    v1::PutFrameRequest request;
    if (parse(part, request) && (request.has_frame() || !request.chunk().empty())) {
      if (request.has_frame()) send();
      bytes += request.chunk();
      put.push_back(std::move(request));
      continue;
    }
    send();
    ask(node, part);
    if (end == std::string_view::npos) break;
  }
  send();

  const v1::CaptureManifest manifest = node.archive().manifest();
  FUZZ_CHECK(manifest.frames().empty() || check_manifest(manifest).ok());
  for (const v1::Frame& frame : manifest.frames()) {
    const absl::StatusOr<std::string> file = node.archive().read_frame_bytes(frame.file());
    FUZZ_CHECK(file.ok() && checksum_of(*file) == frame.checksum());
  }
}

}  // namespace glasswing::fuzz
