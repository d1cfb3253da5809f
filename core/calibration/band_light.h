// The light of bands as camera rows see it: what core/calibration/light_step fits. Times in seconds, from the
// first change on.
#pragma once

#include <vector>

#include "core/calibration/light_step.h"

namespace glasswing {

inline double seconds_of(nanoseconds time) {
  return 1e-9 * static_cast<double>(time.count());
}

double dot(const std::vector<double>& a, const std::vector<double>& b);
// Takes the mean off.
void centre(std::vector<double>& values);

// A few camera rows side by side, over all frames.
struct Track {
  std::vector<double> start, end, light;  // light less its mean
  double square = 0.0;                    // sum of light^2
};

// At most 64, of as many rows each as possible.
std::vector<Track> tracks_of(const LightRecord& record);

// When a band is switched on and off.
class Band {
 public:
  Band(const LightRecord& record, size_t band);

  // Its mean light over each exposure, if it is half way `centre` after a change and settles in `settle`.
  std::vector<double> seen_by(const Track& track, double centre, double settle) const;

 private:
  double integral(double t, double settle, size_t& done) const;

  std::vector<double> at_, sign_;
  std::vector<double> sum_, moment_;  // of signs, and of signs times, of the changes before
};

struct Left {
  double square = 0.0;    // sum over all samples
  double variance = 0.0;  // mean square where the light changed during an exposure; of all if that is more
};
// What bands with these delays and this settling time leave unexplained.
Left left_by(const std::vector<Band>& bands, const std::vector<Track>& tracks,
             const std::vector<double>& delays, double settle);

}  // namespace glasswing
