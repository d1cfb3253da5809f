// The server side of ReadRows: encodes rows of an archive's frames as a sequence of messages.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/support/byte_buffer.h>

#include <memory>
#include <optional>

#include "core/archive/archive_store.h"
#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {

class RowChunks {
 public:
  // Errors are those of ReadRows.
  static absl::StatusOr<std::unique_ptr<RowChunks>> create(ArchiveStore& store, v1::ReadRowsRequest request);

  // The next message, which keeps its plain frames mapped; none at the end. DATA_LOSS names an unreadable
  // frame.
  absl::StatusOr<std::optional<grpc::ByteBuffer>> next();

 private:
  RowChunks(std::shared_ptr<Archive> archive, v1::ReadRowsRequest request)
      : archive_(std::move(archive)), request_(std::move(request)), offset_(request_.offset_bytes()) {}

  // `size` bytes of a frame's requested rows, from byte `within` of them on: in the mapped file where it is
  // plain, otherwise decompressed. DATA_LOSS names the file.
  absl::StatusOr<grpc::Slice> piece_of(const std::shared_ptr<const MappedFile>& mapped,
                                       const std::string& file, size_t within, size_t size) const;

  const std::shared_ptr<Archive> archive_;
  const v1::ReadRowsRequest request_;
  std::int64_t offset_;  // of the next chunk
};

}  // namespace glasswing
