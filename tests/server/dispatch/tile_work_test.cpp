// What the job store keeps of a solve, also as earlier versions wrote it.
#include <gtest/gtest.h>

#include "glasswing/v1/tile_work.pb.h"
#include "server/dispatch/tile_dispatcher.h"

namespace glasswing {
namespace {

// Earlier versions stored the answer to ClaimTile, with these fields set.
v1::ClaimTileResponse as_stored_before() {
  v1::ClaimTileResponse work;
  work.set_method("gaussian");
  (*work.mutable_options())["modes"] = std::string("2");  // g++ 12 warns of the literal alone
  work.set_archive_address("127.0.0.1:7442");
  for (const int row : {1, 5, 9}) work.add_survey_rows(row);
  return work;
}

Lease lease_of(const std::string& work) {
  return {.id = {.job = 7, .tile = 3, .attempt = 2},
          .session = "vase",
          .work = work,
          .range = {.first = 40, .count = 8},
          .server_address = "lab1:7440",
          .own = true};
}

TEST(TileWork, ReadsWhatEarlierVersionsStored) {
  v1::TileWork work;
  ASSERT_TRUE(work.ParseFromString(as_stored_before().SerializeAsString()));
  EXPECT_EQ(work.method(), "gaussian");
  EXPECT_EQ(work.options().at("modes"), "2");
  EXPECT_EQ(work.archive_address(), "127.0.0.1:7442");
  EXPECT_EQ(std::vector<int>(work.survey_rows().begin(), work.survey_rows().end()), (std::vector{1, 5, 9}));
  EXPECT_EQ(work.SerializeAsString(), as_stored_before().SerializeAsString());
  // Bytes of an earlier version, as they stand in its store: fields 5 to 7 and 11.
  const std::string bytes(
      "\x2a\x05"
      "alpha"
      "\x32\x06\x0a\x01"
      "k"
      "\x12\x01"
      "v"
      "\x3a\x03"
      "a:1"
      "\x5a\x02\x04\x09");
  ASSERT_TRUE(work.ParseFromString(bytes));
  EXPECT_EQ(work.method(), "alpha");
  EXPECT_EQ(work.options().at("k"), "v");
  EXPECT_EQ(work.archive_address(), "a:1");
  EXPECT_EQ(work.survey_rows(1), 9);
}

TEST(TileWork, FieldsOfAnAnswerThatAreNoneOfItsOwnDoNoHarm) {
  v1::ClaimTileResponse more = as_stored_before();
  more.set_lease_ms(1);
  more.set_first_row(99);
  more.add_copy_addresses("stale:1");
  more.mutable_lease()->set_session("other");
  const v1::ClaimTileResponse claimed = claimed_tile(lease_of(more.SerializeAsString())).value();
  EXPECT_EQ(claimed.lease().session(), "vase");
  EXPECT_EQ(claimed.first_row(), 40);
  EXPECT_EQ(claimed.lease_ms(), 0);
  EXPECT_TRUE(claimed.copy_addresses().empty());
}

TEST(TileWork, IsToldToTheSolverOfEachTile) {
  v1::TileWork work;
  work.set_method("gaussian");
  (*work.mutable_options())["modes"] = std::string("2");  // g++ 12 warns of the literal alone
  work.set_archive_address("127.0.0.1:7442");
  work.add_survey_rows(4);
  const v1::ClaimTileResponse rows = claimed_tile(lease_of(work.SerializeAsString())).value();
  EXPECT_EQ(rows.method(), "gaussian");
  EXPECT_EQ(rows.options().at("modes"), "2");
  EXPECT_EQ(rows.archive_address(), "127.0.0.1:7442");
  EXPECT_EQ(rows.survey_rows_size(), 1);
  EXPECT_EQ(rows.lease().job(), 7);
  EXPECT_EQ(rows.lease().tile(), 3);
  EXPECT_EQ(rows.lease().attempt(), 2);
  EXPECT_EQ(rows.first_row(), 40);
  EXPECT_EQ(rows.row_count(), 8);
  EXPECT_EQ(rows.frame_count(), 0);
  EXPECT_EQ(rows.server_address(), "");

  work.set_method("ramp");
  Lease lease = lease_of(work.SerializeAsString());
  lease.own = false;
  const v1::ClaimTileResponse frames = claimed_tile(lease).value();
  EXPECT_EQ(frames.first_frame(), 40);
  EXPECT_EQ(frames.frame_count(), 8);
  EXPECT_EQ(frames.row_count(), 0);
  EXPECT_EQ(frames.server_address(), "lab1:7440");

  EXPECT_TRUE(absl::IsDataLoss(claimed_tile(lease_of("\xff")).status()));
}

}  // namespace
}  // namespace glasswing
