// A node that holds an archive of noise, and a reader of its files that is independent of our code: pixels
// start at byte 256, row by row.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "core/archive/archive_service.h"
#include "core/service/service.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {

struct MadeArchive {
  static constexpr int kWidth = 301, kHeight = 157, kFrames = 5;  // several chunks, none aligned to rows
  static constexpr size_t kRowBytes = size_t{6} * kWidth;

  static v1::CaptureManifest header() {
    v1::CaptureManifest manifest;
    manifest.set_session("s");
    manifest.set_created("2026-11-01T12:00:00Z");
    manifest.mutable_camera()->set_width_px(kWidth);
    manifest.mutable_camera()->set_height_px(kHeight);
    return manifest;
  }
  // Compressed frames are dim, as otherwise they would stay plain.
  static void fill(ArchiveStore& store, FrameForm form = FrameForm::kPlain) {
    const std::shared_ptr<Archive> archive = store.create(header()).value();
    std::mt19937 random(7);
    std::vector<Archive::NewFrame> frames(kFrames);
    for (int i = 0; i < kFrames; ++i) {
      frames[i].record.set_step(i);
      frames[i].record.mutable_stimulus()->set_kind("solid");
      frames[i].image = Image16(kWidth, kHeight);
      for (std::uint16_t& sample : frames[i].image.samples)
        sample = static_cast<std::uint16_t>(random() % (form == FrameForm::kPlain ? 65536 : 500));
    }
    ASSERT_OK(archive->add(frames, form));
    ASSERT_OK(archive->seal());
  }
  static std::string file(int frame) { return "frames/00000" + std::to_string(frame) + ".tif"; }
};

inline std::string bytes_of(const std::filesystem::path& path) {
  std::ostringstream bytes;
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  return bytes.str();
}

inline void write_over(const std::filesystem::path& path, size_t at, char with) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(at));
  file.put(with);
}

// Rows of frames, frame after frame, read from the files.
inline std::string rows_of(const std::filesystem::path& archive, const std::vector<int>& frames, int first,
                           int count) {
  std::string rows;
  for (const int frame : frames) {
    rows += bytes_of(archive / MadeArchive::file(frame))
                .substr(256 + MadeArchive::kRowBytes * static_cast<size_t>(first),
                        MadeArchive::kRowBytes * static_cast<size_t>(count));
  }
  return rows;
}

// A node that serves the archives below a directory.
struct ArchiveNode {
  explicit ArchiveNode(const std::filesystem::path& archives, const std::string& address = "127.0.0.1:0")
      : directory(archives), store(archives), service(store) {
    EXPECT_OK(store.prepare());
    host = ServiceHost::start({.address = address}, {&service}).value();
  }
  ~ArchiveNode() {
    service.stop();
    host->stop(std::chrono::milliseconds(0));
  }
  const std::string& address() const { return host->address(); }
  std::filesystem::path archive() const { return directory / "s"; }

  const std::filesystem::path directory;
  ArchiveStore store;
  ArchiveServiceImpl service;
  std::unique_ptr<ServiceHost> host;
};

class ArchiveTest : public testing::Test {
 protected:
  const TemporaryDirectory root_;
};

}  // namespace glasswing
