// Reads from nodes that are healthy, away, damaged or lying.
#include "core/archive/remote_archive.h"

#include <xxhash.h>

#include <atomic>
#include <mutex>

#include "core/import/foreign_manifest.h"
#include "tests/core/archive/made_archive.h"
#include "tests/core/archive/tampering_relay.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

std::string text_of(const FrameRows& rows) {
  std::string text;
  for (const auto& frame : rows.rows)
    text.append(reinterpret_cast<const char*>(frame.data()), frame.size_bytes());
  return text;
}

// Serves an archive's rows by plain messages, altered by `spoil`.
class FakeNode final : public v1::ArchiveService::Service {
 public:
  // Called before each chunk, with its number over all calls; a status that is not OK ends the call.
  using Spoil = std::function<grpc::Status(int chunk, v1::ReadRowsResponse& response)>;

  FakeNode(std::filesystem::path archive, Spoil spoil)
      : archive_(std::move(archive)), spoil_(std::move(spoil)) {
    host_ = ServiceHost::start({}, {this}).value();
  }
  const std::string& address() const { return host_->address(); }
  std::vector<std::int64_t> offsets_asked() const {
    const std::lock_guard lock(mutex_);
    return offsets_;
  }

 private:
  static constexpr size_t kChunk = 50'000;

  grpc::Status GetManifest(grpc::ServerContext*, const v1::GetManifestRequest*,
                           v1::GetManifestResponse* response) override {
    *response->mutable_manifest() = read_any_manifest(archive_).value();
    return grpc::Status::OK;
  }
  // Claims to be on the reader's machine, in a directory that the reader cannot see.
  grpc::Status LocateArchive(grpc::ServerContext*, const v1::LocateArchiveRequest*,
                             v1::LocateArchiveResponse* response) override {
    response->set_directory("/nonexistent");
    response->set_boot_id(boot_id());
    return grpc::Status::OK;
  }
  grpc::Status ReadRows(grpc::ServerContext*, const v1::ReadRowsRequest* request,
                        grpc::ServerWriter<v1::ReadRowsResponse>* writer) override {
    std::vector<int> frames;
    for (const std::string& file : request->files()) frames.push_back(file[12] - '0');
    const std::string rows = rows_of(archive_, frames, request->first_row(), request->row_count());
    {
      const std::lock_guard lock(mutex_);
      offsets_.push_back(request->offset_bytes());
    }
    for (size_t at = request->offset_bytes(); at < rows.size(); at += kChunk) {
      v1::ReadRowsResponse response;
      response.set_offset_bytes(static_cast<std::int64_t>(at));
      response.set_chunk(rows.substr(at, kChunk));
      response.set_checksum(XXH3_64bits(response.chunk().data(), response.chunk().size()));
      const grpc::Status spoilt = spoil_(chunks_++, response);
      if (!spoilt.ok()) return spoilt;
      writer->Write(response);
    }
    return grpc::Status::OK;
  }

  const std::filesystem::path archive_;
  const Spoil spoil_;
  std::atomic<int> chunks_ = 0;
  mutable std::mutex mutex_;
  std::vector<std::int64_t> offsets_;  // guarded by mutex_
  std::unique_ptr<ServiceHost> host_;
};

grpc::Status well(int, v1::ReadRowsResponse&) {
  return grpc::Status::OK;
}

class RemoteArchiveTest : public ArchiveTest {
 protected:
  static constexpr int kFirst = 20, kCount = 100;

  void SetUp() override {
    for (std::unique_ptr<ArchiveNode>* node : {&a_, &b_}) {
      *node = std::make_unique<ArchiveNode>(root_ / (node == &a_ ? "a" : "b"));
      MadeArchive::fill((*node)->store);
    }
    manifest_ = a_->store.find("s").value()->manifest();
    expected_ = rows_of(a_->archive(), all_, kFirst, kCount);
  }
  void TearDown() override {
    a_ = nullptr;
    b_ = nullptr;
    ArchiveTest::TearDown();
  }
  absl::StatusOr<FrameRows> read(const std::vector<std::string>& addresses,
                                 Reading reading = Reading::kNeverMapped) const {
    return RemoteArchive(addresses, "s", {}, reading).rows(manifest_, all_, kFirst, kCount);
  }
  void expect_read(const absl::StatusOr<FrameRows>& rows) const {
    ASSERT_OK(rows);
    EXPECT_EQ(text_of(*rows), expected_);
    EXPECT_OK(rows->intact());
  }
  // Which of two nodes is asked first depends on the process; so the failing one comes first in one of both
  // orders, and the other is then asked only for the rest.
  void expect_read_in_both_orders(const FakeNode& failing, const FakeNode& other, std::int64_t rest) const {
    expect_read(read({failing.address(), other.address()}));
    expect_read(read({other.address(), failing.address()}));
    std::vector<std::int64_t> asked = other.offsets_asked();
    std::ranges::sort(asked);
    EXPECT_EQ(asked, (std::vector<std::int64_t>{0, rest}));
  }
  // Flips a bit of frame 2, in the rows that are read.
  static void damage(const ArchiveNode& node) {
    const std::filesystem::path path = node.archive() / MadeArchive::file(2);
    const size_t at = 256 + 50 * MadeArchive::kRowBytes;
    write_over(path, at, static_cast<char>(bytes_of(path)[at] ^ 4));
  }

  const std::vector<int> all_ = {0, 1, 2, 3, 4};
  std::unique_ptr<ArchiveNode> a_, b_;
  v1::CaptureManifest manifest_;
  std::string expected_;
};

TEST_F(RemoteArchiveTest, RegionsAreTheFilesBytesMappedOrRead) {
  std::mt19937 random(3);
  const auto below = [&](int end) { return static_cast<int>(random() % static_cast<unsigned>(end)); };
  for (const Reading reading : {Reading::kMappedIfHere, Reading::kNeverMapped}) {
    const RemoteArchive archive({a_->address(), b_->address()}, "s", {}, reading);
    const absl::StatusOr<v1::CaptureManifest> manifest = archive.manifest();
    ASSERT_OK(manifest);
    EXPECT_EQ(manifest->SerializeAsString(), manifest_.SerializeAsString());
    for (int trial = 0; trial < 25; ++trial) {
      std::vector<int> frames(1 + below(6));
      for (int& frame : frames) frame = below(MadeArchive::kFrames);
      const int first = below(MadeArchive::kHeight), count = 1 + below(MadeArchive::kHeight - first);
      const absl::StatusOr<FrameRows> rows = archive.rows(manifest_, frames, first, count);
      ASSERT_OK(rows);
      EXPECT_EQ(text_of(*rows), rows_of(a_->archive(), frames, first, count));
      EXPECT_EQ(rows->mapped.size(), reading == Reading::kMappedIfHere ? frames.size() : 0);
      const absl::StatusOr<std::vector<std::uint16_t>> samples =
          archive.samples(manifest_, frames, first, count);
      ASSERT_OK(samples);
      EXPECT_EQ(std::string(reinterpret_cast<const char*>(samples->data()), samples->size() * 2),
                text_of(*rows));
    }
    EXPECT_TRUE(absl::IsInvalidArgument(archive.rows(manifest_, {0}, 0, MadeArchive::kHeight + 1).status()));
  }
}

TEST_F(RemoteArchiveTest, WhatBreaksOffIsTakenUpWhereItWas) {
  // Each call ends after three chunks; the reader requests what is missing, nothing twice.
  const FakeNode halting(a_->archive(), [](int chunk, v1::ReadRowsResponse&) {
    return chunk % 3 == 2 ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "gone") : grpc::Status::OK;
  });
  expect_read(read({halting.address()}));
  const std::vector<std::int64_t> asked = halting.offsets_asked();
  ASSERT_EQ(asked.size(), (expected_.size() / 50'000) / 2 + 1);
  for (size_t i = 0; i < asked.size(); ++i) EXPECT_EQ(asked[i], static_cast<std::int64_t>(i) * 100'000);
}

TEST_F(RemoteArchiveTest, ANodeThatNeverGoesOnIsLeftForTheNextCopyAtTheSameOffset) {
  const FakeNode stuck(a_->archive(), [](int chunk, v1::ReadRowsResponse&) {
    return chunk >= 2 ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "gone") : grpc::Status::OK;
  });
  const FakeNode other(b_->archive(), well);
  expect_read_in_both_orders(stuck, other, 100'000);
}

TEST_F(RemoteArchiveTest, ADamagedChunkIsNeverUsed) {
  const auto flip = [](int chunk, v1::ReadRowsResponse& response) {
    if (chunk >= 4) (*response.mutable_chunk())[17] ^= 1;
    return grpc::Status::OK;
  };
  const FakeNode lying(a_->archive(), flip);
  const FakeNode other(b_->archive(), well);
  expect_read_in_both_orders(lying, other, 4 * 50'000);

  const FakeNode alone(a_->archive(), flip);
  const absl::Status status = read({alone.address()}).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  // The byte at 200,000 is in the second frame.
  EXPECT_NE(status.message().find("frames/000001.tif"), std::string::npos) << status;
  EXPECT_NE(status.message().find(alone.address()), std::string::npos) << status;

  const FakeNode once(a_->archive(), [](int chunk, v1::ReadRowsResponse& response) {
    if (chunk == 4) (*response.mutable_chunk())[17] ^= 1;
    return grpc::Status::OK;
  });
  expect_read(read({once.address()}));  // damaged in transit: a retry helps
}

TEST_F(RemoteArchiveTest, AConnectionThatIsCutAgainAndAgainCostsLittleMore) {
  // Cut after about every 400 kB; data in flight and one incomplete chunk are sent again.
  std::atomic<size_t> cuts = 0;
  size_t next = 400'000;
  TamperingRelay relay(a_->address(), [&](std::string&, size_t before) {
    if (before < next) return true;
    next = before + 400'000;
    ++cuts;
    return false;
  });
  const RemoteArchive archive({relay.address()}, "s", {}, Reading::kNeverMapped);
  std::vector<int> frames;
  for (int i = 0; i < 40; ++i) frames.push_back(i % MadeArchive::kFrames);
  const absl::StatusOr<FrameRows> rows = archive.rows(manifest_, frames, 0, MadeArchive::kHeight);
  // No chunk of 1 MiB ever arrives whole: the read fails, and neither hangs nor invents data.
  EXPECT_TRUE(absl::IsUnavailable(rows.status())) << rows.status();
  EXPECT_GE(cuts.load(), 4u);
}

TEST_F(RemoteArchiveTest, AConnectionThatIsCutIsTakenUp) {
  std::atomic<size_t> cuts = 0;
  size_t next = 3'000'000;
  TamperingRelay relay(a_->address(), [&](std::string&, size_t before) {
    if (before < next) return true;
    next = before + 3'000'000;
    ++cuts;
    return false;
  });
  const RemoteArchive archive({relay.address()}, "s", {}, Reading::kNeverMapped);
  std::vector<int> frames;
  for (int i = 0; i < 40; ++i) frames.push_back(i % MadeArchive::kFrames);
  const absl::StatusOr<FrameRows> rows = archive.rows(manifest_, frames, 0, MadeArchive::kHeight);
  ASSERT_OK(rows);
  const std::string expected = rows_of(a_->archive(), frames, 0, MadeArchive::kHeight);
  EXPECT_EQ(text_of(*rows), expected);
  EXPECT_GE(cuts.load(), 2u);
  // Only the received part of an incomplete chunk is sent twice, plus some protocol overhead.
  EXPECT_LE(relay.sent(), expected.size() + (cuts + 1) * (1 << 20) + expected.size() / 50);
}

TEST_F(RemoteArchiveTest, WhateverTheNetworkFlipsTheRowsAreRightOrNone) {
  std::mt19937 random(9);
  int failed = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const size_t at = random() % (2 * expected_.size());
    TamperingRelay relay(a_->address(), [&](std::string& bytes, size_t before) {
      if (before <= at && at < before + bytes.size())
        bytes[at - before] = static_cast<char>(bytes[at - before] ^ (1 << (at % 8)));
      return true;
    });
    const absl::StatusOr<FrameRows> rows = read({relay.address()});
    if (rows.ok()) {
      EXPECT_EQ(text_of(*rows), expected_) << at;
    } else {
      ++failed;
    }
  }
  EXPECT_EQ(failed, 0) << "one flipped bit is mended by another try";
}

TEST_F(RemoteArchiveTest, ADamagedFileIsReadFromAnotherNode) {
  for (const Reading reading : {Reading::kMappedIfHere, Reading::kNeverMapped}) {
    if (reading == Reading::kMappedIfHere) damage(*a_);
    expect_read(read({a_->address(), b_->address()}, reading));
    expect_read(read({b_->address(), a_->address()}, reading));
  }
  damage(*b_);
  for (const Reading reading : {Reading::kMappedIfHere, Reading::kNeverMapped}) {
    const absl::Status status = read({a_->address(), b_->address()}, reading).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    for (const ArchiveNode* node : {a_.get(), b_.get()}) {
      const std::string file = (node->archive() / MadeArchive::file(2)).string();
      EXPECT_NE(status.message().find(file), std::string::npos) << status;
      EXPECT_NE(status.message().find(node->address()), std::string::npos) << status;
    }
  }
}

TEST_F(RemoteArchiveTest, ANodeThatIsAwayMayHaveWhatTheOthersLack) {
  const std::string away = b_->address();
  b_ = nullptr;
  expect_read(read({away, a_->address()}));
  expect_read(read({a_->address(), away}));
  damage(*a_);
  const absl::Status status = read({a_->address(), away}).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_NE(status.message().find("frames/000002.tif"), std::string::npos) << status;
  EXPECT_NE(status.message().find(away), std::string::npos) << status;
}

// Serves one file: the first call breaks, and the second sends the rest with a wrong byte.
class UnsteadyFileNode final : public v1::ArchiveService::Service {
 public:
  static constexpr size_t kSent = 700;

  explicit UnsteadyFileNode(std::string file) : file_(std::move(file)) {
    host_ = ServiceHost::start({}, {this}).value();
  }
  const std::string& address() const { return host_->address(); }
  const std::vector<std::int64_t>& offsets_asked() const { return offsets_; }

 private:
  grpc::Status ReadFile(grpc::ServerContext*, const v1::ReadFileRequest* request,
                        grpc::ServerWriter<v1::ReadFileResponse>* writer) override {
    offsets_.push_back(request->offset_bytes());
    std::string rest = file_.substr(request->offset_bytes());
    if (offsets_.size() == 1) rest.resize(kSent);
    if (offsets_.size() == 2) rest.back() = static_cast<char>(rest.back() ^ 1);
    v1::ReadFileResponse response;
    response.set_chunk(rest);
    writer->Write(response);
    return offsets_.size() == 1 ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "gone") : grpc::Status::OK;
  }

  const std::string file_;
  std::vector<std::int64_t> offsets_;  // of one call after another
  std::unique_ptr<ServiceHost> host_;
};

TEST_F(RemoteArchiveTest, AFileThatBreaksOffIsReadOnAndADamagedOneAgain) {
  const std::string whole = bytes_of(a_->archive() / MadeArchive::file(2));
  UnsteadyFileNode node(whole);
  const auto file = RemoteArchive({node.address()}, "s", {}).file(manifest_, 2);
  ASSERT_OK(file);
  EXPECT_EQ(*file, whole);
  EXPECT_EQ(node.offsets_asked(), (std::vector<std::int64_t>{0, UnsteadyFileNode::kSent, 0}));
  v1::CaptureManifest lying = manifest_;
  lying.mutable_frames(2)->set_size_bytes(std::int64_t{1} << 60);
  EXPECT_TRUE(absl::IsDataLoss(RemoteArchive({node.address()}, "s", {}).file(lying, 2).status()));
}

TEST_F(RemoteArchiveTest, CompressedRowsAreThoseThatWereStored) {
  ArchiveNode node(root_ / "compressed");
  MadeArchive::fill(node.store, FrameForm::kCompressed);
  const v1::CaptureManifest manifest = node.store.find("s").value()->manifest();
  for (const auto& [first, count] : {std::pair{0, MadeArchive::kHeight}, {kFirst, kCount}, {18, 1}}) {
    std::string expected;
    for (const int frame : all_) {
      const Image16 image = decode_tiff(bytes_of(node.archive() / MadeArchive::file(frame))).value();
      const size_t row = image.samples.size() / static_cast<size_t>(image.height_px);
      const std::span<const std::uint16_t> rows =
          std::span(image.samples)
              .subspan(row * static_cast<size_t>(first), row * static_cast<size_t>(count));
      expected.append(reinterpret_cast<const char*>(rows.data()), rows.size_bytes());
    }
    for (const Reading reading : {Reading::kMappedIfHere, Reading::kNeverMapped}) {
      const auto rows = RemoteArchive({node.address()}, "s", {}, reading).rows(manifest, all_, first, count);
      ASSERT_OK(rows);
      EXPECT_OK(rows->intact());
      EXPECT_TRUE(text_of(*rows) == expected) << first;
    }
  }
}

TEST_F(RemoteArchiveTest, AMappedFileThatIsCutShortIsReadOtherwiseTheNextTime) {
  const RemoteArchive archive({a_->address(), b_->address()}, "s", {});
  const absl::StatusOr<FrameRows> rows = archive.rows(manifest_, all_, kFirst, kCount);
  ASSERT_OK(rows);
  ASSERT_EQ(rows->mapped.size(), all_.size());
  for (const ArchiveNode* node : {a_.get(), b_.get()})
    std::filesystem::resize_file(node->archive() / MadeArchive::file(3), 5000);
  EXPECT_NE(text_of(*rows), expected_);
  EXPECT_TRUE(absl::IsUnavailable(rows->intact())) << rows->intact();
  const absl::Status again = archive.rows(manifest_, all_, kFirst, kCount).status();
  EXPECT_TRUE(absl::IsDataLoss(again)) << again;
}

TEST_F(RemoteArchiveTest, ADirectoryThatCannotBeSeenIsReadFrom) {
  // The directory exists but its files were moved away after the node had verified them.
  const FakeNode elsewhere(a_->archive(), well);
  const absl::StatusOr<FrameRows> rows = read({elsewhere.address()}, Reading::kMappedIfHere);
  expect_read(rows);
  EXPECT_TRUE(rows->mapped.empty());
}

TEST_F(RemoteArchiveTest, AStopEndsTheWaiting) {
  std::stop_source stop;
  std::atomic<bool> asked = false;
  const FakeNode slow(a_->archive(), [&](int, v1::ReadRowsResponse&) {
    asked = true;
    asked.notify_all();
    return grpc::Status(grpc::StatusCode::UNAVAILABLE, "gone");
  });
  const std::jthread stopping([&] {
    asked.wait(false);
    stop.request_stop();
  });
  const RemoteArchive archive({slow.address()}, "s", stop.get_token());
  EXPECT_TRUE(absl::IsCancelled(archive.rows(manifest_, all_, kFirst, kCount).status()));
}

}  // namespace
}  // namespace glasswing
