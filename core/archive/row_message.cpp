#include "core/archive/row_message.h"

#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>
#include <grpcpp/support/proto_buffer_reader.h>
#include <xxhash.h>

#include <array>

#include "core/base/checksum.h"
#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {
namespace {

using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;
using google::protobuf::io::CodedOutputStream;
using v1::ReadRowsResponse;

constexpr std::uint32_t kOffsetTag = WireFormatLite::MakeTag(ReadRowsResponse::kOffsetBytesFieldNumber,
                                                             WireFormatLite::WIRETYPE_VARINT),
                        kChecksumTag = WireFormatLite::MakeTag(ReadRowsResponse::kChecksumFieldNumber,
                                                               WireFormatLite::WIRETYPE_FIXED64),
                        kChunkTag = WireFormatLite::MakeTag(ReadRowsResponse::kChunkFieldNumber,
                                                            WireFormatLite::WIRETYPE_LENGTH_DELIMITED);
constexpr size_t kMaxHeaderBytes = (1 + 10) + (1 + 8) + (1 + 5);

}  // namespace

std::uint64_t checksum_of_pieces(std::span<const grpc::Slice> pieces) {
  if (pieces.size() == 1) return XXH3_64bits(pieces[0].begin(), pieces[0].size());
  RunningChecksum checksum;
  for (const grpc::Slice& piece : pieces)
    checksum.add({reinterpret_cast<const char*>(piece.begin()), piece.size()});
  return checksum.value();
}

grpc::ByteBuffer encode_row_chunk(std::int64_t offset_bytes, std::vector<grpc::Slice> pieces) {
  size_t size = 0;
  for (const grpc::Slice& piece : pieces) size += piece.size();
  std::array<std::uint8_t, kMaxHeaderBytes> header{};
  std::uint8_t* end = header.data();
  end = CodedOutputStream::WriteTagToArray(kOffsetTag, end);
  end = CodedOutputStream::WriteVarint64ToArray(static_cast<std::uint64_t>(offset_bytes), end);
  end = CodedOutputStream::WriteTagToArray(kChecksumTag, end);
  end = CodedOutputStream::WriteLittleEndian64ToArray(checksum_of_pieces(pieces), end);
  end = CodedOutputStream::WriteTagToArray(kChunkTag, end);
  end = CodedOutputStream::WriteVarint32ToArray(static_cast<std::uint32_t>(size), end);
  pieces.insert(pieces.begin(), grpc::Slice(header.data(), static_cast<size_t>(end - header.data())));
  return grpc::ByteBuffer(pieces.data(), pieces.size());
}

absl::Status take_row_chunk(grpc::ByteBuffer& message, std::span<char> rows, std::int64_t& offset_bytes) {
  grpc::ProtoBufferReader slices(&message);
  CodedInputStream in(&slices);
  std::uint64_t offset = 0, checksum = 0;
  std::uint32_t size = 0, tag = 0;
  // Fields come in the order of their numbers, zeros omitted, as all protobuf writers emit them.
  bool understood = true;
  while (understood && (tag = in.ReadTag()) != kChunkTag) {
    understood = (tag == kOffsetTag && in.ReadVarint64(&offset)) ||
                 (tag == kChecksumTag && in.ReadLittleEndian64(&checksum));
  }
  understood = understood && in.ReadVarint32(&size) && size > 0;
  const auto wanted = static_cast<std::uint64_t>(offset_bytes);
  if (!understood || offset != wanted || size > rows.size() - wanted) {
    return absl::InternalError(
        fmt::format("it sent {} bytes from {} on, where those from {} to {} were requested", size, offset,
                    wanted, rows.size()));
  }
  char* const chunk = rows.data() + wanted;
  if (!in.ReadRaw(chunk, static_cast<int>(size)) || XXH3_64bits(chunk, size) != checksum) {
    return absl::DataLossError(fmt::format("the {} bytes from {} on arrived damaged", size, wanted));
  }
  offset_bytes += size;
  return absl::OkStatus();
}

}  // namespace glasswing
