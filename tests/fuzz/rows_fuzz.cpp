// ReadRows at both ends: a node answers any request with an error or exactly the rows requested, and a reader
// accepts only valid messages.
#include <google/protobuf/stubs/logging.h>

#include "core/archive/row_chunks.h"
#include "core/archive/row_message.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

constexpr int kWidth_px = 50, kHeight_px = 70, kFrames = 3;  // 21,000 bytes per frame: some pieces are mapped

Image16 picture(int number) {
  Image16 image(kWidth_px, kHeight_px);
  for (size_t i = 0; i < image.samples.size(); ++i)
    image.samples[i] = static_cast<std::uint16_t>(i * 977 + static_cast<size_t>(number) * 31);
  return image;
}

std::string file_of(int number) {
  return "frames/00000" + std::to_string(number) + ".tif";
}

// Created once, with three frames.
ArchiveStore& store() {
  static ArchiveStore store(scratch_directory());
  static const bool made = [] {
    v1::CaptureManifest header;
    header.set_session("s");
    header.mutable_camera()->set_width_px(kWidth_px);
    header.mutable_camera()->set_height_px(kHeight_px);
    std::vector<Archive::NewFrame> frames(kFrames);
    for (int i = 0; i < kFrames; ++i) {
      frames[i].record.set_step(i);
      frames[i].image = picture(i);
    }
    return store.create(header).value()->add(frames).ok();
  }();
  FUZZ_CHECK(made);
  return store;
}

std::string rows_of(const std::string& file, int first_row, int row_count) {
  constexpr size_t kRowBytes = kWidth_px * 6;
  for (int i = 0; i < kFrames; ++i) {
    if (file_of(i) != file) continue;
    const Image16 image = picture(i);
    const auto* const bytes = reinterpret_cast<const char*>(image.samples.data());
    return {bytes + static_cast<size_t>(first_row) * kRowBytes, static_cast<size_t>(row_count) * kRowBytes};
  }
  return std::string(static_cast<size_t>(row_count) * kRowBytes, '?');
}

void answer(const v1::ReadRowsRequest& request) {
  const absl::StatusOr<std::unique_ptr<RowChunks>> chunks = RowChunks::create(store(), request);
  if (!chunks.ok()) {
    FUZZ_CHECK(!chunks.status().message().empty());
    return;
  }
  constexpr size_t kMax = 1 << 21;
  std::string expected;
  for (const std::string& file : request.files()) {
    expected += rows_of(file, request.first_row(), request.row_count());
    if (expected.size() > kMax) return;  // more of the same
  }
  std::string got(expected.size(), '\0');
  std::int64_t offset = request.offset_bytes();
  for (;;) {
    absl::StatusOr<std::optional<grpc::ByteBuffer>> message = (*chunks)->next();
    if (!message.ok()) {
      FUZZ_CHECK(absl::IsNotFound(message.status()));  // one of the files
      return;
    }
    if (!message->has_value()) break;
    FUZZ_CHECK(take_row_chunk(**message, got, offset).ok());
  }
  const size_t begin = request.offset_bytes();
  FUZZ_CHECK(static_cast<size_t>(offset) == expected.size());
  FUZZ_CHECK(got.substr(begin) == expected.substr(begin));
}

// A message that a node may send instead of a valid answer.
void take(std::string_view input) {
  const grpc::Slice whole(input.data(), input.size());
  for (const size_t room : {size_t{8}, size_t{600}}) {
    grpc::ByteBuffer message(&whole, 1);
    std::string rows(room, 'x');
    std::int64_t offset = 4;
    if (!take_row_chunk(message, rows, offset).ok()) {
      FUZZ_CHECK(offset == 4);
      continue;
    }
    FUZZ_CHECK(offset > 4 && static_cast<size_t>(offset) <= room);
    FUZZ_CHECK(rows.substr(0, 4) == "xxxx");
    FUZZ_CHECK(rows.find_first_not_of('x', static_cast<size_t>(offset)) == std::string::npos);
    const grpc::Slice chunk(rows.data() + 4, static_cast<size_t>(offset) - 4);
    // The field is in the message unless it is 0, which is omitted.
    const std::uint64_t checksum = checksum_of_pieces({&chunk, 1});
    const std::string_view bytes(reinterpret_cast<const char*>(&checksum), sizeof checksum);
    FUZZ_CHECK(checksum == 0 || input.find(bytes) != std::string_view::npos);
  }
}

}  // namespace

std::vector<std::string> seeds() {
  std::vector<std::string> seeds;
  const auto add = [&](std::vector<std::string> files, int first_row, int row_count, std::int64_t offset) {
    v1::ReadRowsRequest request;
    request.set_session("s");
    for (std::string& file : files) *request.add_files() = std::move(file);
    request.set_first_row(first_row);
    request.set_row_count(row_count);
    request.set_offset_bytes(offset);
    seeds.push_back(request.SerializeAsString());
  };
  const std::string first = file_of(0), second = file_of(1), third = file_of(2);
  add({first, second, third}, 0, kHeight_px, 0);
  add({third, first, first}, 17, 3, 901);
  add({second}, kHeight_px - 1, 1, kWidth_px * 6);
  add({first, "frames/000009.tif"}, 0, 60, 18000);
  add({first, "../../secret"}, 0, 1, -1);
  add(std::vector<std::string>(200, second), 0, 70, 4000000);
  add({}, 0, 1, 0);
  const grpc::Slice chunk("some pixels");
  grpc::ByteBuffer message = encode_row_chunk(4, {chunk});
  grpc::Slice whole;
  FUZZ_CHECK(message.DumpToSingleSlice(&whole).ok());
  seeds.emplace_back(reinterpret_cast<const char*>(whole.begin()), whole.size());
  return seeds;
}

void try_input(std::string_view input) {
  static const google::protobuf::LogSilencer silent;  // silences complaints about strings that are not UTF-8
  v1::ReadRowsRequest request;
  if (request.ParseFromArray(input.data(), static_cast<int>(input.size()))) answer(request);
  take(input);
}

}  // namespace glasswing::fuzz
