// Zero-copy encoding of ReadRowsResponse: the server sends slices of mapped files after a short header, and
// the reader copies received bytes once, to their destination.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/byte_buffer.h>

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace glasswing {

// XXH3-64 of the concatenated pieces.
std::uint64_t checksum_of_pieces(std::span<const grpc::Slice> pieces);

// Encodes a chunk that starts at `offset_bytes` and consists of the concatenated pieces.
grpc::ByteBuffer encode_row_chunk(std::int64_t offset_bytes, std::vector<grpc::Slice> pieces);

// Copies a message's chunk to rows[offset_bytes...], verifies it and adds its size to `offset_bytes`.
// INTERNAL: not such a message, or one that starts elsewhere or exceeds `rows`; DATA_LOSS: the checksum does
// not match. After an error, rows behind the offset are undefined.
absl::Status take_row_chunk(grpc::ByteBuffer& message, std::span<char> rows, std::int64_t& offset_bytes);

}  // namespace glasswing
