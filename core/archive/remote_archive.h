// A session's frames on the nodes that hold them. On the same machine their files are mapped; else rows are
// read in chunks with checksums, and a connection that breaks is taken up where it was, there or at another
// copy. What came damaged is never used.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/archive/archive_location.h"
#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {

// Rows of some frames, r, g, b, 16 bit.
struct FrameRows {
  std::vector<std::span<const std::uint16_t>> rows;       // of each frame that was asked for
  std::shared_ptr<const void> owner;                      // of the samples
  std::vector<std::shared_ptr<const MappedFile>> mapped;  // where they lie; none: they were read

  // To be asked after the samples were used. UNAVAILABLE: a file was cut short, or its disk failed, while it
  // was mapped; what was made of the samples is worth nothing, and asking for them again takes another way.
  absl::Status intact() const;
};

enum class Reading { kMappedIfHere, kNeverMapped };

// Thread-safe. UNAVAILABLE: a node is away, and no other could help; DATA_LOSS names node and frame: no copy
// of it can be read. Once `stop` was asked for, what waits for a node fails.
class RemoteArchive {
 public:
  // `addresses`, at least one: of the node that captured it first, then of those with copies. They are asked
  // in an order of this process's own, so that several solvers share the load, but those on this machine
  // first.
  RemoteArchive(const std::vector<std::string>& addresses, std::string session, std::stop_token stop,
                Reading reading = Reading::kMappedIfHere);
  ~RemoteArchive();

  absl::StatusOr<v1::CaptureManifest> manifest() const;
  // Of these frames, places in manifest.frames.
  absl::StatusOr<FrameRows> rows(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                                 int first_row, int row_count) const;
  // Likewise, as samples of their own, one frame's after another.
  absl::StatusOr<std::vector<std::uint16_t>> samples(const v1::CaptureManifest& manifest,
                                                     const std::vector<int>& frames, int first_row,
                                                     int row_count) const;

 private:
  struct Source;
  struct Request;
  // After a call that failed: the connection broke, and is worth another try; what came was damaged, which
  // another copy's may not be; or the node cannot read its own copy, and never will.
  enum class Next { kNone, kSame, kOther, kOnlyOthers };
  struct Outcome {
    absl::Status status;
    Next next = Next::kNone;
  };

  void locate_archives() const;
  absl::StatusOr<FrameRows> map(const Request& request, const Source& source) const;
  absl::StatusOr<FrameRows> map_any(const Request& request) const;
  absl::Status read(const Request& request, std::span<char> rows) const;
  // Reads on from `done`.
  Outcome read_from(const Source& source, const Request& request, std::span<char> rows,
                    std::int64_t& done) const;

  const std::string session_;
  const std::stop_token stop_;
  const Reading reading_;
  mutable std::once_flag located_;
  mutable std::vector<std::unique_ptr<Source>> sources_;  // in the order in which they are asked
};

}  // namespace glasswing
