// How good a captured session is, beside the others of its series with the same plan. From figures that its
// capture, its solve and its matte have.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "glasswing/v1/session.pb.h"
#include "server/sessions/matte_quality.h"

namespace glasswing {

class Verdicts {
 public:
  // At least as many others tell what is usual.
  static constexpr size_t kFewest = 4;

  // Of all sessions, which must have their plans; `qualities`: of their mattes, by session.
  explicit Verdicts(std::span<const v1::Session> sessions,
                    std::map<std::string, MatteQuality> qualities = {});

  // False: the session is not captured, or measured devices.
  static bool judges(const v1::Session& session);
  // Without measures unless judges().
  v1::SessionVerdict of(const v1::Session& session) const;

 private:
  // Null: unknown.
  const MatteQuality* quality_of(const v1::Session& session) const;

  std::map<std::string, MatteQuality> qualities_;
  std::map<std::string, std::vector<v1::Session>> series_;  // captured ones, by series and plan
};

}  // namespace glasswing
