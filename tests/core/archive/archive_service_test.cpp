// Compares what a node sends of an archive with its files.
#include "core/archive/archive_service.h"

#include <fmt/format.h>
#include <xxhash.h>

#include "core/archive/archive_location.h"
#include "core/base/checksum.h"
#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

class ArchiveService : public ArchiveTest {
 protected:
  void SetUp() override {
    node_ = std::make_unique<ArchiveNode>(root_);
    MadeArchive::fill(node_->store);
    stub_ = v1::ArchiveService::NewStub(dial(node_->address()));
  }
  void TearDown() override {
    node_ = nullptr;
    ArchiveTest::TearDown();
  }
  // Checks offset, size and checksum of every chunk.
  grpc::Status read(const v1::ReadRowsRequest& request, std::string& rows) const {
    grpc::ClientContext context;
    const auto reader = stub_->ReadRows(&context, request);
    rows.clear();
    for (v1::ReadRowsResponse response; reader->Read(&response);) {
      EXPECT_EQ(response.offset_bytes(), request.offset_bytes() + static_cast<std::int64_t>(rows.size()));
      EXPECT_GT(response.chunk().size(), 0u);
      EXPECT_LE(response.chunk().size(), kChunkBytes);
      EXPECT_EQ(response.checksum(), XXH3_64bits(response.chunk().data(), response.chunk().size()));
      rows += response.chunk();
    }
    return reader->Finish();
  }
  static v1::ReadRowsRequest request_for(const std::vector<int>& frames, int first, int count) {
    v1::ReadRowsRequest request;
    request.set_session("s");
    request.set_first_row(first);
    request.set_row_count(count);
    for (const int frame : frames) request.add_files(MadeArchive::file(frame));
    return request;
  }
  grpc::Status locate(const std::vector<int>& frames, v1::LocateArchiveResponse& place) const {
    v1::LocateArchiveRequest request;
    request.set_session("s");
    for (const int frame : frames) request.add_files(MadeArchive::file(frame));
    grpc::ClientContext context;
    return stub_->LocateArchive(&context, request, &place);
  }

  std::unique_ptr<ArchiveNode> node_;
  std::unique_ptr<v1::ArchiveService::Stub> stub_;
};

TEST_F(ArchiveService, AnyRegionIsTheFilesBytesFromAnyOffset) {
  std::mt19937 random(11);
  const auto below = [&](int end) { return static_cast<int>(random() % static_cast<unsigned>(end)); };
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<int> frames(1 + below(7));  // in any order, some twice
    for (int& frame : frames) frame = below(MadeArchive::kFrames);
    const int first = below(MadeArchive::kHeight), count = 1 + below(MadeArchive::kHeight - first);
    const std::string expected = rows_of(node_->archive(), frames, first, count);
    v1::ReadRowsRequest request = request_for(frames, first, count);
    std::string rows;
    ASSERT_OK(read(request, rows));
    ASSERT_EQ(rows, expected);
    const size_t offset = below(static_cast<int>(expected.size()) + 1);
    request.set_offset_bytes(static_cast<std::int64_t>(offset));
    ASSERT_OK(read(request, rows));
    ASSERT_EQ(rows, expected.substr(offset));
  }
}

TEST_F(ArchiveService, FramesOfACallAreStoredInTheirOrderOrNotAtAll) {
  v1::CaptureManifest header = MadeArchive::header();
  header.set_session("new");
  ASSERT_OK(node_->store.create(header));
  const std::filesystem::path frames = node_->directory / "new" / "frames";
  // Names are a file's letter and the number of its picture.
  const auto put = [&](const std::vector<std::string>& names, const std::string& damaged) {
    grpc::ClientContext context;
    v1::PutFrameResponse stored;
    const auto writer = stub_->PutFrame(&context, &stored);
    for (const std::string& name : names) {
      const std::string bytes = bytes_of(node_->archive() / MadeArchive::file(name.back() - '0'));
      v1::PutFrameRequest message;
      message.set_session("new");
      message.mutable_frame()->set_file(fmt::format("frames/{}.tif", name.front()));
      message.mutable_frame()->set_step(-1);
      message.mutable_frame()->set_checksum(checksum_of(bytes));
      writer->Write(message);
      message.Clear();
      message.set_chunk(bytes.substr(0, 1000));
      writer->Write(message);
      message.set_chunk(name == damaged ? bytes.substr(1001) : bytes.substr(1000));
      writer->Write(message);
    }
    writer->WritesDone();
    return writer->Finish().error_code();
  };
  for (const char* damaged : {"z1", "m0", "a2"}) {
    EXPECT_EQ(put({"z1", "m0", "a2"}, damaged), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(node_->store.find("new").value()->manifest().frames_size(), 0);
    EXPECT_TRUE(std::filesystem::is_empty(frames)) << "nothing is left of " << damaged;
  }
  ASSERT_EQ(put({"z1", "m0", "a2"}, ""), grpc::StatusCode::OK);
  ASSERT_EQ(put({"m0", "b3"}, ""), grpc::StatusCode::OK) << "one of them is stored already";
  EXPECT_EQ(put({"c4", "m1"}, ""), grpc::StatusCode::ALREADY_EXISTS) << "m is another picture";
  const v1::CaptureManifest kept = Archive::open(node_->directory / "new").value()->manifest();
  std::string order;
  for (const v1::Frame& frame : kept.frames()) {
    order += frame.file().at(7);
    const std::string bytes = bytes_of(node_->directory / "new" / frame.file());
    EXPECT_EQ(checksum_of(bytes), frame.checksum());
    EXPECT_EQ(static_cast<std::int64_t>(bytes.size()), frame.size_bytes());
  }
  EXPECT_EQ(order, "zmab");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(frames), {}), 4) << "no file is left over";
}

// Acknowledged, the sender would take it for stored.
TEST_F(ArchiveService, AnotherPictureOfAStoredStepIsRefused) {
  v1::CaptureManifest header = MadeArchive::header();
  header.set_session("new");
  ASSERT_EQ(node_->store.create(header).status(), absl::OkStatus());
  const auto put = [&](int picture, const std::string& file) {
    const std::string bytes = bytes_of(node_->archive() / MadeArchive::file(picture));
    grpc::ClientContext context;
    v1::PutFrameResponse stored;
    const auto writer = stub_->PutFrame(&context, &stored);
    v1::PutFrameRequest message;
    message.set_session("new");
    message.mutable_frame()->set_file(file);
    message.mutable_frame()->set_step(7);
    message.mutable_frame()->set_checksum(checksum_of(bytes));
    message.set_chunk(bytes);
    writer->Write(message);
    writer->WritesDone();
    return writer->Finish().error_code();
  };
  ASSERT_EQ(put(0, "frames/7.tif"), grpc::StatusCode::OK);
  EXPECT_EQ(put(0, "frames/7.tif"), grpc::StatusCode::OK) << "the same again";
  for (const bool sealed : {false, true}) {
    if (sealed) {
      ASSERT_OK(node_->store.find("new").value()->seal());
    }
    EXPECT_EQ(put(1, "frames/7.tif"), grpc::StatusCode::ALREADY_EXISTS) << sealed;
    EXPECT_EQ(put(1, "frames/8.tif"), grpc::StatusCode::ALREADY_EXISTS) << sealed;
  }
  EXPECT_EQ(Archive::open(node_->directory / "new").value()->manifest().frames_size(), 1);
}

TEST_F(ArchiveService, AnImportsTokenOpensItsOwnArchiveUntilTheImportEnds) {
  const std::string bytes = bytes_of(node_->archive() / MadeArchive::file(0));
  const auto create = [&](const std::string& session, const std::string& token) {
    grpc::ClientContext context;
    v1::CreateArchiveRequest request;
    *request.mutable_manifest() = MadeArchive::header();
    request.mutable_manifest()->set_session(session);
    request.set_import_token(token);
    v1::CreateArchiveResponse created;
    return stub_->CreateArchive(&context, request, &created).ok();
  };
  const auto put = [&](const std::string& session, const std::string& token) {
    grpc::ClientContext context;
    v1::PutFrameResponse stored;
    const auto writer = stub_->PutFrame(&context, &stored);
    v1::PutFrameRequest message;
    message.set_session(session);
    message.set_import_token(token);
    message.mutable_frame()->set_file("frames/0.tif");
    message.mutable_frame()->set_step(-1);
    message.mutable_frame()->set_checksum(checksum_of(bytes));
    message.set_chunk(bytes);
    writer->Write(message);
    writer->WritesDone();
    return writer->Finish().error_code();
  };
  ASSERT_TRUE(create("a", "1f"));
  ASSERT_TRUE(create("b", "2e"));
  ASSERT_TRUE(create("captured", ""));
  EXPECT_EQ(put("b", "1f"), grpc::StatusCode::PERMISSION_DENIED) << "the token of another import";
  EXPECT_EQ(put("captured", "1f"), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(put("a", "1f"), grpc::StatusCode::OK);
  ASSERT_TRUE(create("a", "3d"));
  EXPECT_EQ(put("a", "1f"), grpc::StatusCode::PERMISSION_DENIED) << "the import was begun again";
  EXPECT_EQ(put("a", "3d"), grpc::StatusCode::OK);
  grpc::ClientContext context;
  v1::SealArchiveRequest seal;
  seal.set_session("a");
  v1::SealArchiveResponse sealed;
  ASSERT_OK(stub_->SealArchive(&context, seal, &sealed));
  EXPECT_EQ(put("a", "3d"), grpc::StatusCode::PERMISSION_DENIED);
}

TEST_F(ArchiveService, ListsTheArchivesThatAreHere) {
  v1::CaptureManifest other = MadeArchive::header();
  other.set_session("a");
  ASSERT_OK(node_->store.create(other));
  std::filesystem::create_directories(root_ / "empty");
  std::filesystem::create_directories(root_ / ".removed-x/frames");
  grpc::ClientContext context;
  const auto reader = stub_->ListArchives(&context, {});
  std::vector<std::string> names;
  for (v1::ListArchivesResponse some; reader->Read(&some);)
    names.insert(names.end(), some.sessions().begin(), some.sessions().end());
  EXPECT_OK(reader->Finish());
  EXPECT_EQ(names, (std::vector<std::string>{"a", "s"}));
}

TEST_F(ArchiveService, AnArchiveThatWasDeletedIsNotAnsweredFromMemory) {
  std::string rows;
  ASSERT_OK(read(request_for({0}, 0, 1), rows));
  std::filesystem::remove_all(node_->archive());
  EXPECT_EQ(read(request_for({0}, 0, 1), rows).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(ArchiveService, RowsThatAreNotThereAreRefused) {
  std::string rows;
  v1::ReadRowsRequest request = request_for({0, 1}, 0, 2);
  for (const std::int64_t offset :
       {std::int64_t{-1}, static_cast<std::int64_t>(4 * MadeArchive::kRowBytes + 1)}) {
    request.set_offset_bytes(offset);
    EXPECT_EQ(read(request, rows).error_code(), grpc::StatusCode::OUT_OF_RANGE) << offset;
  }
  EXPECT_EQ(read(request_for({0}, -1, 2), rows).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(read(request_for({0}, 0, 0), rows).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(read(request_for({0}, 1, MadeArchive::kHeight), rows).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(read(request_for({7}, 0, 1), rows).error_code(), grpc::StatusCode::NOT_FOUND);
  request = request_for({0}, 0, 1);
  request.set_session("another");
  EXPECT_EQ(read(request, rows).error_code(), grpc::StatusCode::NOT_FOUND);
  request.set_session("../s");
  EXPECT_EQ(read(request, rows).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(ArchiveService, AFileThatChangesLaterIsFoundOut) {
  const std::filesystem::path path = node_->archive() / MadeArchive::file(1);
  const std::string whole = bytes_of(path);
  std::string rows;
  v1::LocateArchiveResponse place;
  const v1::ReadRowsRequest request = request_for({0, 1}, 0, MadeArchive::kHeight);
  ASSERT_OK(read(request, rows));
  const auto expect_damaged = [&](const std::string& how) {
    for (const grpc::Status& status : {read(request, rows), locate({0, 1}, place)}) {
      EXPECT_EQ(status.error_code(), grpc::StatusCode::DATA_LOSS) << how;
      EXPECT_NE(status.error_message().find("frames/000001.tif"), std::string::npos)
          << status.error_message();
    }
    EXPECT_OK(read(request_for({0}, 0, 1), rows)) << "the others can be read";
  };
  write_over(path, whole.size() / 2, static_cast<char>(whole[whole.size() / 2] ^ 1));
  expect_damaged("altered");
  std::filesystem::resize_file(path, whole.size() / 2);
  expect_damaged("cut short");
  std::filesystem::remove(path);
  expect_damaged("removed");
  std::ofstream(path, std::ios::binary) << whole;
  EXPECT_OK(read(request, rows));
}

TEST_F(ArchiveService, WhoReadsWhatIsDeletedReadsOn) {
  // One message has arrived; flow control admits only a part of the rest before it is read.
  const std::vector<int> frames(40, 3);
  const std::string expected = rows_of(node_->archive(), frames, 0, MadeArchive::kHeight);
  grpc::ClientContext context;
  const auto reader = stub_->ReadRows(&context, request_for(frames, 0, MadeArchive::kHeight));
  v1::ReadRowsResponse response;
  ASSERT_TRUE(reader->Read(&response));
  std::string rows = response.chunk();
  const std::shared_ptr<const MappedFile> mapped =
      node_->store.find("s").value()->map(MadeArchive::file(3)).value();
  ASSERT_OK(node_->store.remove("s"));
  EXPECT_FALSE(std::filesystem::exists(node_->archive()));
  EXPECT_EQ(mapped->bytes().substr(256), std::string_view(expected).substr(0, expected.size() / 40));
  while (reader->Read(&response)) rows += response.chunk();
  // The read either completes or reports that the file is gone; it never returns other bytes.
  const grpc::Status status = reader->Finish();
  EXPECT_EQ(rows, expected.substr(0, rows.size()));
  EXPECT_TRUE(status.ok() ? rows == expected : status.error_code() == grpc::StatusCode::DATA_LOSS);
}

TEST_F(ArchiveService, ToldWhereItLiesASecondReaderFindsTheSameDirectory) {
  v1::LocateArchiveResponse place;
  ASSERT_OK(locate({0, 1, 2}, place));
  EXPECT_TRUE(std::filesystem::equivalent(place.directory(), node_->archive()));
  const std::shared_ptr<LocalArchive> local = LocalArchive::open(place);
  ASSERT_NE(local, nullptr);
  EXPECT_EQ(LocalArchive::open(place), local) << "one is enough";
  const auto mapped = local->map(MadeArchive::file(2), {MadeArchive::kWidth, MadeArchive::kHeight});
  ASSERT_OK(mapped);
  EXPECT_EQ((*mapped)->bytes(), bytes_of(node_->archive() / MadeArchive::file(2)));
  EXPECT_FALSE(local->map(MadeArchive::file(2), {MadeArchive::kWidth, MadeArchive::kHeight + 1}).ok());
  EXPECT_FALSE(local->map(MadeArchive::file(2), {MadeArchive::kHeight, MadeArchive::kWidth}).ok());

  for (int other = 0; other < 4; ++other) {
    v1::LocateArchiveResponse elsewhere = place;
    if (other == 0) elsewhere.set_boot_id("another machine's");
    if (other == 1) elsewhere.set_inode(place.inode() + 1);
    if (other == 2) elsewhere.set_device(place.device() + 1);
    if (other == 3) elsewhere.set_directory(root_.string());
    EXPECT_EQ(LocalArchive::open(elsewhere), nullptr) << other;
  }
}

// Truncated under the mapping after the checksum was verified: no signal, no invented pixels.
TEST_F(ArchiveService, AMappingWhoseFileIsCutShortSaysSo) {
  const std::shared_ptr<const MappedFile> mapped =
      MappedFile::open(node_->archive() / MadeArchive::file(0),
                       256 + MadeArchive::kHeight * MadeArchive::kRowBytes)
          .value();
  EXPECT_TRUE(mapped->intact());
  std::filesystem::resize_file(node_->archive() / MadeArchive::file(0), 256);
  EXPECT_EQ(mapped->bytes().back(), '\0');
  EXPECT_FALSE(mapped->intact());
  EXPECT_EQ(mapped->bytes()[8192], '\0') << "all after it reads as zeros";
}

TEST_F(ArchiveService, FilesCutShortWhileTheyAreReadEndNoNodeAndMakeUpNothing) {
  const std::filesystem::path path = node_->archive() / MadeArchive::file(0);
  const std::string whole = bytes_of(path);
  const std::vector<int> frames(12, 0);
  const std::string expected = rows_of(node_->archive(), frames, 0, MadeArchive::kHeight);
  const v1::ReadRowsRequest request = request_for(frames, 0, MadeArchive::kHeight);
  std::mt19937 random(5);
  int damaged = 0;
  for (int trial = 0; trial < 40; ++trial) {
    grpc::ClientContext context;
    const auto reader = stub_->ReadRows(&context, request);
    v1::ReadRowsResponse response;
    std::string rows;
    // Refused at once: the node still holds the mapping of the truncated file.
    if (reader->Read(&response)) rows = response.chunk();
    std::filesystem::resize_file(path, random() % whole.size());
    while (reader->Read(&response)) {
      // Chunks that the reader refuses may hold anything.
      if (response.checksum() != XXH3_64bits(response.chunk().data(), response.chunk().size())) break;
      rows += response.chunk();
    }
    context.TryCancel();
    damaged += !reader->Finish().ok();
    EXPECT_EQ(rows, expected.substr(0, rows.size()));
    std::ofstream(path, std::ios::binary) << whole;
  }
  EXPECT_GT(damaged, 0) << "every cut came too late";
  std::string rows;
  EXPECT_OK(read(request, rows));
  EXPECT_EQ(rows, expected);
}

}  // namespace
}  // namespace glasswing
