// The rules by which sessions end.
#pragma once

#include <absl/time/time.h>

#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "glasswing/v1/session.pb.h"
#include "glasswing/v1/storage_service.pb.h"

namespace glasswing {

struct RetentionRules {
  double frames_days = 0.0;              // frames are kept as long after their matte; 0: for ever
  int newest = 0;                        // as many sessions of a series are kept; 0: all
  std::vector<std::string> exempt_tags;  // sessions with one of these stay

  bool any() const { return frames_days > 0.0 || newest > 0; }
};

// A session, and what the server knows of its matte.
struct StoredSession {
  v1::Session session;
  std::int64_t matte_bytes = 0;
  absl::Time solved = absl::InfiniteFuture();  // when its matte was finished
};

// What the rules end now, in the order of `sessions`, which are the newest first, without those in the trash.
// Only sessions at rest end, and only captured ones count for a series; calibrations, sessions that a person
// took back, and those with an exempt tag stay, but count.
std::vector<v1::SessionEnding> endings(const RetentionRules& rules, std::span<const StoredSession> sessions,
                                       absl::Time now);

}  // namespace glasswing
