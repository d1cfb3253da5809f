#include "core/archive/row_message.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "glasswing/v1/archive_service.grpc.pb.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

std::vector<grpc::Slice> cut(const std::string& bytes, std::mt19937& random) {
  std::vector<grpc::Slice> pieces;
  for (size_t at = 0; at < bytes.size();) {
    const size_t size = std::min<size_t>(bytes.size() - at, 1 + random() % 5000);
    pieces.emplace_back(bytes.data() + at, size);
    at += size;
  }
  return pieces;
}

std::string noise(size_t size, std::mt19937& random) {
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

TEST(RowMessage, IsWhatProtobufWritesAndReads) {
  std::mt19937 random(1);
  for (const std::int64_t offset :
       {std::int64_t{0}, std::int64_t{1}, std::int64_t{12345}, std::int64_t{1} << 40}) {
    const std::string chunk = noise(1 + random() % 40000, random);
    grpc::ByteBuffer ours = encode_row_chunk(offset, cut(chunk, random));
    v1::ReadRowsResponse parsed;
    ASSERT_OK(grpc::SerializationTraits<v1::ReadRowsResponse>::Deserialize(&ours, &parsed));
    EXPECT_EQ(parsed.offset_bytes(), offset);
    EXPECT_EQ(parsed.chunk(), chunk);
    if (offset > 20000) continue;  // room for the rows before
    for (const bool by_protobuf : {false, true}) {
      grpc::ByteBuffer message = encode_row_chunk(offset, cut(chunk, random));
      bool own = false;
      if (by_protobuf) {
        message.Clear();
        ASSERT_OK(grpc::SerializationTraits<v1::ReadRowsResponse>::Serialize(parsed, &message, &own));
      }
      std::string rows(static_cast<size_t>(offset) + chunk.size() + 3, 'x');
      std::int64_t done = offset;
      ASSERT_OK(take_row_chunk(message, rows, done));
      EXPECT_EQ(done, offset + static_cast<std::int64_t>(chunk.size()));
      EXPECT_EQ(rows, std::string(offset, 'x') + chunk + "xxx");
    }
  }
}

TEST(RowMessage, EveryFlippedByteIsFound) {
  std::mt19937 random(2);
  const std::string chunk = noise(300, random);
  grpc::ByteBuffer message = encode_row_chunk(0, cut(chunk, random));
  grpc::Slice whole;
  ASSERT_OK(message.DumpToSingleSlice(&whole));
  for (size_t at = 0; at < whole.size(); ++at) {
    std::string flipped(reinterpret_cast<const char*>(whole.begin()), whole.size());
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << random() % 8));
    const grpc::Slice slice(flipped);
    grpc::ByteBuffer damaged(&slice, 1);
    std::string rows(chunk.size(), '\0');
    std::int64_t done = 0;
    EXPECT_FALSE(take_row_chunk(damaged, rows, done).ok()) << at;
    EXPECT_EQ(done, 0) << at;
  }
}

TEST(RowMessage, WhatWasNotAskedForIsRefused) {
  std::mt19937 random(3);
  const std::string chunk = noise(100, random);
  std::string rows(99, '\0');
  std::int64_t done = 0;
  grpc::ByteBuffer too_long = encode_row_chunk(0, cut(chunk, random));
  EXPECT_TRUE(absl::IsInternal(take_row_chunk(too_long, rows, done)));
  rows.resize(300);
  grpc::ByteBuffer elsewhere = encode_row_chunk(100, cut(chunk, random));
  EXPECT_TRUE(absl::IsInternal(take_row_chunk(elsewhere, rows, done)));
  grpc::ByteBuffer nothing;
  EXPECT_TRUE(absl::IsInternal(take_row_chunk(nothing, rows, done)));
  EXPECT_EQ(done, 0);
}

}  // namespace
}  // namespace glasswing
