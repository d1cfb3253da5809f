// The light of bands as camera rows see it, the model that core/calibration/light_step fits. Times are in
// seconds since the first change.
#pragma once

#include <vector>

#include "core/calibration/light_step.h"

namespace glasswing {

inline double seconds_of(nanoseconds time) {
  return 1e-9 * static_cast<double>(time.count());
}

double dot(const std::vector<double>& a, const std::vector<double>& b);
// Subtracts the mean.
void centre(std::vector<double>& values);

// A group of adjacent camera rows, over all frames.
struct Track {
  std::vector<double> start, end, light;  // light less its mean
  double square = 0.0;                    // sum of light^2
};

// At most 64 groups, as equal in size as possible.
std::vector<Track> tracks_of(const LightRecord& record);

// The times at which a band is switched on and off.
class Band {
 public:
  Band(const LightRecord& record, size_t band);

  // The band's mean light over each exposure, if it is half way `centre` after a change and settles in
  // `settle`.
  std::vector<double> seen_by(const Track& track, double centre, double settle) const;

 private:
  double integral(double t, double settle, size_t& done) const;

  std::vector<double> at_, sign_;
  std::vector<double> sum_, moment_;  // prefix sums over changes: of signs, and of sign * time
};

struct Left {
  double square = 0.0;    // sum over all samples
  double variance = 0.0;  // mean square where the light changed during an exposure, or of all if larger
};
// The residual of bands with these delays and this settling time.
Left left_by(const std::vector<Band>& bands, const std::vector<Track>& tracks,
             const std::vector<double>& delays, double settle);

}  // namespace glasswing
