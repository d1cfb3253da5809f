// A session's frames on the nodes that hold them. On the same machine their files are mapped, and compressed
// rows decompressed; otherwise rows are read in chunks with checksums, and a broken connection is resumed
// where it stopped, at the same node or another copy. Damaged chunks are never used.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/archive/archive_location.h"
#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {

// Rows of several frames, 16 bit: r, g, b, or one channel (core/image/mosaic.h).
struct FrameRows {
  std::vector<std::span<const std::uint16_t>> rows;       // by requested frame
  std::shared_ptr<const void> owner;                      // keeps the samples alive
  std::vector<std::shared_ptr<const MappedFile>> mapped;  // files whose bytes some of them are

  // Check after using the samples. UNAVAILABLE: a file was truncated, or its disk failed, while it was
  // mapped; results computed from the samples are invalid, and requesting the rows again avoids that file.
  absl::Status intact() const;
};

enum class Reading { kMappedIfHere, kNeverMapped };

// Thread-safe. UNAVAILABLE: a node is unreachable and no other has a copy; DATA_LOSS names node and frame: no
// copy can be read. Once `stop` is requested, pending calls fail.
class RemoteArchive {
 public:
  // `addresses`, at least one: the capturing node's first, then those of copies. Nodes are asked in an order
  // that depends on this process, so that several solvers share the load; nodes on this machine come first.
  RemoteArchive(const std::vector<std::string>& addresses, std::string session, std::stop_token stop,
                Reading reading = Reading::kMappedIfHere);
  ~RemoteArchive();

  absl::StatusOr<v1::CaptureManifest> manifest() const;
  // Rows of `frames`, indices into manifest.frames.
  absl::StatusOr<FrameRows> rows(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                                 int first_row, int row_count) const;
  // The same, copied to one array, frame after frame.
  absl::StatusOr<std::vector<std::uint16_t>> samples(const v1::CaptureManifest& manifest,
                                                     const std::vector<int>& frames, int first_row,
                                                     int row_count) const;

  // A frame's file, byte for byte. Verified by the record's checksum.
  absl::StatusOr<std::string> file(const v1::CaptureManifest& manifest, int frame) const;

 private:
  struct Source;
  struct Request;
  // What to try after a failed call: the same node (the connection broke), another (the data arrived
  // damaged), or only others from now on (the node cannot read its copy).
  enum class Next { kNone, kSame, kOther, kOnlyOthers };
  struct Outcome {
    absl::Status status;
    Next next = Next::kNone;
  };

  void locate_archives() const;
  absl::StatusOr<FrameRows> map(const Request& request, const Source& source) const;
  absl::StatusOr<FrameRows> map_any(const Request& request) const;
  absl::Status read(const Request& request, std::span<char> rows) const;
  static Outcome outcome_of(const grpc::Status& end, const Source& source, std::string_view what);
  // Calls `read`, which continues at its byte `done`, with one node after another until one succeeds.
  using Read = std::function<Outcome(const Source&, std::int64_t& done)>;
  absl::Status read_any(const Read& read) const;
  Outcome read_file_from(const Source& source, const v1::Frame& record, std::span<char> bytes,
                         std::int64_t& done) const;
  Outcome read_from(const Source& source, const Request& request, std::span<char> rows,
                    std::int64_t& done) const;

  const std::string session_;
  const std::stop_token stop_;
  const Reading reading_;
  mutable std::once_flag located_;
  mutable std::vector<std::unique_ptr<Source>> sources_;  // in the order of asking
};

}  // namespace glasswing
