#include "console/routes/archive_tar.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/frame/archive_json.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr std::int64_t kMaxSize = (std::int64_t{1} << 33) - 1;  // of a file: eleven octal digits
constexpr size_t kBlock = 512, kMaxPlainName = 100;
constexpr std::chrono::minutes kFrameTimeout(10);  // a browser reads as fast as it stores

std::string padding_of(std::int64_t size) {
  return std::string((kBlock - static_cast<size_t>(size) % kBlock) % kBlock, '\0');
}

// One block. `type`: '0' for a file, 'x' for the pax records of the next one.
std::string block_of(const std::string& name, std::int64_t size, char type) {
  std::string block(kBlock, '\0');
  const auto put = [&block](size_t at, const std::string& text) { block.replace(at, text.size(), text); };
  put(0, name.substr(0, kMaxPlainName));
  put(100, "0000644");
  put(108, "0000000");
  put(116, "0000000");
  put(124, fmt::format("{:011o}", size));
  put(136, "00000000000");
  put(148, "        ");  // the checksum's own place counts as blanks
  block[156] = type;
  put(257, "ustar");
  put(263, "00");
  const int sum = std::accumulate(block.begin(), block.end(), 0,
                                  [](int so_far, char c) { return so_far + static_cast<unsigned char>(c); });
  put(148, fmt::format("{:06o}", sum));
  block[154] = '\0';
  return block;
}

// "27 path=vase/frames/17.tif\n": the number counts the record, itself included.
std::string path_record(const std::string& path) {
  const size_t rest = path.size() + 7;  // " path=" and the line's end
  size_t size = rest + 1;
  while (rest + std::to_string(size).size() != size) ++size;
  return fmt::format("{} path={}\n", size, path);
}

std::string header_of(const std::string& path, std::int64_t size) {
  if (path.size() <= kMaxPlainName) return block_of(path, size, '0');
  const std::string record = path_record(path);
  const std::int64_t bytes = record.size();
  return block_of("path", bytes, 'x') + record + padding_of(bytes) + block_of(path, size, '0');
}

}  // namespace

struct ArchiveTar::Reading {
  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReader<v1::ReadFileResponse>> reader;
  RunningChecksum checksum;
  std::int64_t left = 0;  // bytes
};

absl::StatusOr<std::unique_ptr<ArchiveTar>> ArchiveTar::open(std::shared_ptr<grpc::Channel> node,
                                                             const std::string& peer,
                                                             v1::CaptureManifest manifest) {
  absl::Status status = check_manifest(manifest);
  for (const v1::Frame& frame : manifest.frames()) {
    if (frame.size_bytes() > kMaxSize)
      status.Update(absl::DataLossError(fmt::format("{} has {} bytes", frame.file(), frame.size_bytes())));
  }
  if (!status.ok())
    return absl::DataLossError(fmt::format("the manifest of {}: {}", peer, std::string(status.message())));
  return std::unique_ptr<ArchiveTar>(new ArchiveTar(std::move(node), peer, std::move(manifest)));
}

ArchiveTar::ArchiveTar(std::shared_ptr<grpc::Channel> node, std::string peer, v1::CaptureManifest manifest)
    : node_(std::move(node)), peer_(std::move(peer)), manifest_(std::move(manifest)) {}

ArchiveTar::~ArchiveTar() {
  if (reading_ != nullptr) reading_->context.TryCancel();
}

absl::StatusOr<std::string> ArchiveTar::next() {
  if (ended_) return "";
  if (reading_ != nullptr) {
    v1::ReadFileResponse part;
    if (!reading_->reader->Read(&part)) return end_frame();
    reading_->left -= static_cast<std::int64_t>(part.chunk().size());
    reading_->checksum.add(part.chunk());
    if (reading_->left < 0) return end_frame();
    return std::move(*part.mutable_chunk());
  }
  if (frame_ < manifest_.frames_size()) return begin_frame();
  ended_ = true;
  const std::string json = archive_json(manifest_, true);
  const std::int64_t size = json.size();
  return header_of(manifest_.session() + "/manifest.json", size) + json + padding_of(size) +
         std::string(2 * kBlock, '\0');
}

absl::StatusOr<std::string> ArchiveTar::begin_frame() {
  const v1::Frame& frame = manifest_.frames(frame_);
  reading_ = std::make_unique<Reading>();
  reading_->left = frame.size_bytes();
  set_deadline(reading_->context, kFrameTimeout);
  v1::ReadFileRequest request;
  request.set_session(manifest_.session());
  request.set_file(frame.file());
  reading_->reader = v1::ArchiveService::NewStub(node_)->ReadFile(&reading_->context, request);
  return header_of(manifest_.session() + "/" + frame.file(), frame.size_bytes());
}

absl::StatusOr<std::string> ArchiveTar::end_frame() {
  const v1::Frame& frame = manifest_.frames(frame_++);
  const std::unique_ptr<Reading> ended = std::move(reading_);
  if (ended->left < 0) ended->context.TryCancel();
  const grpc::Status status = ended->reader->Finish();
  if (ended->left < 0 || (status.ok() && ended->checksum.text() != frame.checksum()))
    return absl::DataLossError(fmt::format("{} came damaged from {}", frame.file(), peer_));
  GW_RETURN_IF_ERROR(from_grpc(status, peer_));
  const std::string padding = padding_of(frame.size_bytes());
  return padding.empty() ? next() : padding;
}

}  // namespace glasswing
