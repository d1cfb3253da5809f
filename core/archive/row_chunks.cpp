#include "core/archive/row_chunks.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "core/archive/row_message.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

// Smaller pieces are copied: a slice would cost more.
constexpr size_t kMinMappedPiece_bytes = 16 << 10;
// A chunk may span many frames, each of which must be verified first; the reader must not wait longer.
constexpr std::chrono::seconds kMaxWait(1);

using Mapping = std::shared_ptr<const MappedFile>;

grpc::Slice slice_of(const Mapping& mapped, std::string_view bytes) {
  return grpc::Slice(
      const_cast<char*>(bytes.data()), bytes.size(), [](void* owner) { delete static_cast<Mapping*>(owner); },
      new Mapping(mapped));
}

}  // namespace

absl::StatusOr<std::unique_ptr<RowChunks>> RowChunks::create(ArchiveStore& store,
                                                             v1::ReadRowsRequest request) {
  GW_ASSIGN_OR_RETURN(std::shared_ptr<Archive> archive, store.find(request.session()));
  GW_RETURN_IF_ERROR(archive->check_rows(request.first_row(), request.row_count()));
  const std::int64_t size =
      static_cast<std::int64_t>(archive->row_bytes()) * request.row_count() * request.files_size();
  if (request.offset_bytes() < 0 || request.offset_bytes() > size) {
    return absl::OutOfRangeError(
        fmt::format("offset_bytes is {}; it must be 0 to {}", request.offset_bytes(), size));
  }
  return std::unique_ptr<RowChunks>(new RowChunks(std::move(archive), std::move(request)));
}

absl::StatusOr<grpc::Slice> RowChunks::piece_of(const std::shared_ptr<const MappedFile>& mapped,
                                                const std::string& file, size_t within, size_t size) const {
  const size_t row = archive_->row_bytes(), first = static_cast<size_t>(request_.first_row());
  const absl::StatusOr<TiffRows> rows = TiffRows::open(mapped->bytes(), archive_->shape());
  absl::Status status = rows.status();
  if (status.ok() && !rows->plain().empty())
    return slice_of(mapped, mapped->bytes().substr(kTiffPixelOffset + row * first + within, size));
  const size_t begin = within / row, end = (within + size + row - 1) / row;
  std::vector<std::uint16_t> samples((end - begin) * row / 2);
  if (status.ok())
    status = rows->read(static_cast<int>(first + begin), static_cast<int>(end - begin), samples.data());
  if (status.ok()) return grpc::Slice(reinterpret_cast<const char*>(samples.data()) + within % row, size);
  return absl::DataLossError(fmt::format("{} is damaged: {}", (archive_->directory() / file).string(),
                                         std::string(status.message())));
}

absl::StatusOr<std::optional<grpc::ByteBuffer>> RowChunks::next() {
  const size_t frame_bytes = archive_->row_bytes() * static_cast<size_t>(request_.row_count());
  std::vector<grpc::Slice> pieces;
  std::vector<Mapping> mappings;
  std::string copied;
  size_t size = 0;
  const nanoseconds begin = monotonic_now();
  while (size < kChunkBytes && (size == 0 || monotonic_now() - begin < kMaxWait)) {
    const size_t at = static_cast<size_t>(offset_) + size;
    const auto frame = static_cast<int>(at / frame_bytes);
    if (frame == request_.files_size()) break;
    GW_ASSIGN_OR_RETURN(const Mapping mapped, archive_->map(request_.files(frame)));
    const size_t within = at % frame_bytes;
    const size_t piece_bytes = std::min(frame_bytes - within, kChunkBytes - size);
    GW_ASSIGN_OR_RETURN(grpc::Slice piece, piece_of(mapped, request_.files(frame), within, piece_bytes));
    if (frame_bytes < kMinMappedPiece_bytes) {
      copied.append(reinterpret_cast<const char*>(piece.begin()), piece.size());
    } else {
      pieces.push_back(std::move(piece));
    }
    mappings.push_back(mapped);
    size += piece_bytes;
  }
  if (size == 0) return std::nullopt;
  if (!copied.empty()) pieces.emplace_back(copied);
  grpc::ByteBuffer message = encode_row_chunk(offset_, std::move(pieces));
  // The checksum has read every byte, so intact() now shows whether it is that of the files.
  for (size_t i = 0; i < mappings.size(); ++i) {
    if (mappings[i]->intact()) continue;
    const auto frame = static_cast<int>(static_cast<size_t>(offset_) / frame_bytes + i);
    return absl::DataLossError(fmt::format("{} is damaged: it cannot be read to its end",
                                           (archive_->directory() / request_.files(frame)).string()));
  }
  offset_ += static_cast<std::int64_t>(size);
  return message;
}

}  // namespace glasswing
