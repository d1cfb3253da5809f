// Copies an archive between nodes.
#include "core/archive/copy_archive.h"

#include "core/file/file.h"
#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

class CopyArchive : public ArchiveTest {
 protected:
  void SetUp() override {
    from_ = std::make_unique<ArchiveNode>(root_ / "from");
    to_ = std::make_unique<ArchiveNode>(root_ / "to");
    MadeArchive::fill(from_->store);
  }
  void TearDown() override {
    from_ = nullptr;
    to_ = nullptr;
    ArchiveTest::TearDown();
  }
  // Calls the node as the server does; returns all progress messages.
  grpc::Status copy(std::vector<v1::CopyArchiveResponse>* told = nullptr) const {
    const auto stub = v1::ArchiveService::NewStub(dial(to_->address()));
    v1::CopyArchiveRequest request;
    request.set_session("s");
    request.set_from_address(from_->address());
    grpc::ClientContext context;
    const auto reader = stub->CopyArchive(&context, request);
    for (v1::CopyArchiveResponse progress; reader->Read(&progress);)
      if (told != nullptr) told->push_back(progress);
    return reader->Finish();
  }
  void expect_same(const std::string& file) const {
    EXPECT_EQ(bytes_of(to_->archive() / file), bytes_of(from_->archive() / file)) << file;
  }
  void expect_whole_copy() const {
    for (int i = 0; i < MadeArchive::kFrames; ++i) expect_same(MadeArchive::file(i));
    for (const char* file : {"manifest.json", "header.json", "frames.jsonl"}) expect_same(file);
  }
  FileIdentity copied(int frame) const {
    return identity_of(to_->archive() / MadeArchive::file(frame)).value();
  }

  std::unique_ptr<ArchiveNode> from_, to_;
};

TEST_F(CopyArchive, IsTheSameByteForByteAndOutlivesTheNode) {
  std::vector<v1::CopyArchiveResponse> told;
  const grpc::Status status = copy(&told);
  ASSERT_OK(status);
  expect_whole_copy();
  std::int64_t bytes = 0;
  for (int i = 0; i < MadeArchive::kFrames; ++i)
    bytes += static_cast<std::int64_t>(bytes_of(from_->archive() / MadeArchive::file(i)).size());
  EXPECT_EQ(told.front().frames_done(), 0);
  EXPECT_EQ(told.back().frames_done(), MadeArchive::kFrames);
  EXPECT_EQ(told.back().frame_count(), MadeArchive::kFrames);
  EXPECT_EQ(told.back().bytes_done(), bytes);
  EXPECT_EQ(told.back().byte_count(), bytes);
  to_ = nullptr;
  to_ = std::make_unique<ArchiveNode>(root_ / "to");
  EXPECT_EQ(to_->store.find("s").value()->manifest().frames_size(), MadeArchive::kFrames);
}

TEST_F(CopyArchive, CompressedFramesStaySo) {
  from_ = nullptr;
  std::filesystem::remove_all(root_ / "from");
  from_ = std::make_unique<ArchiveNode>(root_ / "from");
  MadeArchive::fill(from_->store, FrameForm::kCompressed);
  const grpc::Status status = copy();
  ASSERT_OK(status);
  expect_whole_copy();
  EXPECT_LT(bytes_of(to_->archive() / MadeArchive::file(0)).size(),
            MadeArchive::kRowBytes * MadeArchive::kHeight);
}

TEST_F(CopyArchive, WhatBrokeOffIsTakenUp) {
  // The other node cannot read its frame 3; the frames before it stay.
  const std::filesystem::path bad = from_->archive() / MadeArchive::file(3);
  const std::string good = bytes_of(bad);
  write_over(bad, 1000, static_cast<char>(good[1000] ^ 1));
  grpc::Status status = copy();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_NE(status.error_message().find(bad.string()), std::string::npos) << status.error_message();
  EXPECT_NE(status.error_message().find(from_->address()), std::string::npos) << status.error_message();
  EXPECT_FALSE(std::filesystem::exists(to_->archive() / "manifest.json")) << "it is not whole";
  const std::vector<FileIdentity> before = {copied(0), copied(1), copied(2)};

  ASSERT_OK(write_file_durably(bad, good));
  std::vector<v1::CopyArchiveResponse> told;
  status = copy(&told);
  ASSERT_OK(status);
  EXPECT_EQ(told.front().frames_done(), 3);
  EXPECT_EQ(before, (std::vector<FileIdentity>{copied(0), copied(1), copied(2)})) << "not copied again";
  expect_whole_copy();
}

TEST_F(CopyArchive, AskedAgainItMendsWhatIsDamaged) {
  ASSERT_OK(copy());
  const std::vector<FileIdentity> before = {copied(0), copied(2), copied(3)};
  write_over(to_->archive() / MadeArchive::file(1), 5000, 'x');
  write_over(to_->archive() / MadeArchive::file(1), 5001, 'y');
  std::filesystem::resize_file(to_->archive() / MadeArchive::file(4), 700);
  EXPECT_FALSE(to_->store.find("s").value()->map(MadeArchive::file(4)).ok());
  ASSERT_OK(copy());
  expect_whole_copy();
  EXPECT_EQ(before, (std::vector<FileIdentity>{copied(0), copied(2), copied(3)}));
}

TEST_F(CopyArchive, AnotherSessionOfTheNameIsLeftAlone) {
  v1::CaptureManifest other = MadeArchive::header();
  other.set_created("2025-11-01T12:00:00Z");
  ASSERT_OK(to_->store.create(other));
  EXPECT_EQ(copy().error_code(), grpc::StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(to_->store.find("s").value()->manifest().frames_size(), 0);
}

TEST_F(CopyArchive, SaysWhichNodeIsAway) {
  const std::string address = from_->address();
  v1::CopyArchiveRequest request;
  request.set_session("s");
  request.set_from_address(address);
  from_ = nullptr;
  const auto stays = [] { return false; };
  absl::Status status = copy_archive(to_->store, request, {}, stays, [](const auto&) { return true; });
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_NE(status.message().find(address), std::string::npos) << status;
  EXPECT_FALSE(std::filesystem::exists(to_->archive()));
  from_ = std::make_unique<ArchiveNode>(root_ / "from", address);
  status = copy_archive(to_->store, request, {}, stays, [](const auto&) { return false; });
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  EXPECT_OK(copy());
  expect_whole_copy();
}

}  // namespace
}  // namespace glasswing
