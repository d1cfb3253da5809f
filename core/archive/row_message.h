// ReadRowsResponse on the wire, its pixels where they are: the server sends slices of mapped files behind a
// few bytes of header, the reader copies what came once, to where it is wanted.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/byte_buffer.h>

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace glasswing {

// XXH3, 64 bits, of these bytes one after another.
std::uint64_t checksum_of_pieces(std::span<const grpc::Slice> pieces);

// The message of a chunk that begins at `offset_bytes` and is these pieces, one after another.
grpc::ByteBuffer encode_row_chunk(std::int64_t offset_bytes, std::vector<grpc::Slice> pieces);

// Copies a message's chunk to rows[offset_bytes...], and adds its size to `offset_bytes` if it is what was
// sent. INTERNAL: it is no such message, or begins elsewhere, or is more than was asked for; DATA_LOSS: it
// has another checksum than it says. Then what lies behind the offset is worth nothing.
absl::Status take_row_chunk(grpc::ByteBuffer& message, std::span<char> rows, std::int64_t& offset_bytes);

}  // namespace glasswing
