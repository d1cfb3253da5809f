// Decides whether frames are stored plain or compressed, so that storing never holds up a capture: compressed
// while they are stored as they arrive; once they wait, in the form that is stored faster, as measured.
#pragma once

#include <array>
#include <cstddef>

#include "core/base/time.h"
#include "core/image/tiff.h"

namespace glasswing {

class FormChoice {
 public:
  // Frames that wait longer are late.
  static constexpr nanoseconds kMaxWait = std::chrono::milliseconds(300);

  // `waited`: since the oldest of the frames was exposed.
  FrameForm choose(nanoseconds waited) const;
  // Records how long frames of `plain_bytes` uncompressed took to store in this form.
  void learn(FrameForm form, size_t plain_bytes, nanoseconds took);

 private:
  std::array<double, 2> ns_per_byte_{};  // by form, newest batches most; 0: not measured
};

}  // namespace glasswing
