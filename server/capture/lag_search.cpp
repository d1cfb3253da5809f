#include "server/capture/lag_search.h"

#include <algorithm>
#include <map>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr nanoseconds kFine = std::chrono::milliseconds(1);

class LagSearch {
 public:
  LagSearch(std::span<const TimeOnScreen> ids, std::span<const FrameTime> frames, const SeesPatch& sees)
      : ids_(ids), frames_(frames), sees_(sees) {}

  absl::StatusOr<std::optional<nanoseconds>> run() {
    nanoseconds shortest = nanoseconds::max();
    for (const TimeOnScreen& id : ids_) shortest = std::min(shortest, id.until - id.from);
    // Lags that show the ids span about the time for which one id is shown.
    const nanoseconds pace = std::max(shortest / 4, kFine);
    for (nanoseconds lag = kEarliestLag - pace; lag <= kLatestLag + pace; lag += pace) {
      GW_ASSIGN_OR_RETURN(const bool seen, shows(lag));
      if (!seen) continue;
      GW_ASSIGN_OR_RETURN(const nanoseconds first, edge(lag, -pace));
      GW_ASSIGN_OR_RETURN(const nanoseconds last, edge(lag, pace));
      return (first + last) / 2;
    }
    return std::nullopt;
  }

 private:
  // The last lag from `seen` on, in the direction of `pace`, that shows the ids.
  absl::StatusOr<nanoseconds> edge(nanoseconds seen, nanoseconds pace) {
    while (std::chrono::abs(pace) > kFine / 2) {
      GW_ASSIGN_OR_RETURN(const bool further, shows(seen + pace));
      if (further)
        seen += pace;
      else
        pace /= 2;
    }
    return seen;
  }

  absl::StatusOr<bool> shows(nanoseconds lag) {
    std::vector<std::int64_t> sequences;
    for (const TimeOnScreen& id : ids_) {
      const nanoseconds from = id.from + lag, until = id.until + lag;
      const auto off_middle = [&](const FrameTime& frame) {
        return frame.start < from || frame.end > until
                   ? nanoseconds::max()
                   : std::chrono::abs(frame.start - from + frame.end - until);
      };
      const auto nearest = std::ranges::min_element(frames_, {}, off_middle);
      if (nearest == frames_.end() || off_middle(*nearest) == nanoseconds::max()) return false;
      sequences.push_back(nearest->sequence);
    }
    const auto known = known_.find(sequences);
    if (known != known_.end()) return known->second;
    GW_ASSIGN_OR_RETURN(const bool seen, sees_(sequences));
    return known_[sequences] = seen;
  }

  const std::span<const TimeOnScreen> ids_;
  const std::span<const FrameTime> frames_;
  const SeesPatch& sees_;
  std::map<std::vector<std::int64_t>, bool> known_;
};

}  // namespace

absl::StatusOr<std::optional<nanoseconds>> find_lag(std::span<const TimeOnScreen> ids,
                                                    std::span<const FrameTime> frames,
                                                    const SeesPatch& sees) {
  return LagSearch(ids, frames, sees).run();
}

}  // namespace glasswing
