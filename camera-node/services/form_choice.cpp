#include "camera-node/services/form_choice.h"

namespace glasswing {

FrameForm FormChoice::choose(nanoseconds waited) const {
  const auto [plain, compressed] = ns_per_byte_;
  const bool compressing_is_faster = compressed > 0.0 && plain > compressed;
  return waited <= kMaxWait || compressing_is_faster ? FrameForm::kCompressed : FrameForm::kPlain;
}

void FormChoice::learn(FrameForm form, size_t plain_bytes, nanoseconds took) {
  constexpr double kNewest = 0.25;
  if (plain_bytes == 0) return;
  double& known = ns_per_byte_[static_cast<size_t>(form)];
  const double now = static_cast<double>(took.count()) / static_cast<double>(plain_bytes);
  known = known == 0.0 ? now : (1.0 - kNewest) * known + kNewest * now;
}

}  // namespace glasswing
