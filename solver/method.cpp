#include "solver/method.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "solver/drift.h"
#include "solver/fringe/fringe_method.h"
#include "solver/gaussian/gaussian_method.h"

namespace glasswing {

absl::StatusOr<FrameStack> whole_stack(std::shared_ptr<const MappedArchive> archive) {
  const int height = archive->manifest().camera().height_px();
  FrameStack stack{
      .manifest = archive->manifest(), .first_row = 0, .row_count = height, .rows = {}, .owner = archive};
  for (int i = 0; i < stack.manifest.frames_size(); ++i) stack.rows.push_back(archive->rows(i, 0, height));
  const auto read_row = [&](int row, const std::vector<int>& frames) {
    std::vector<std::uint16_t> samples;
    for (const int frame : frames) {
      const std::span<const std::uint16_t> own = archive->rows(frame, row, 1);
      samples.insert(samples.end(), own.begin(), own.end());
    }
    return absl::StatusOr<std::vector<std::uint16_t>>(std::move(samples));
  };
  GW_ASSIGN_OR_RETURN(stack.brightness, measure_drift(stack.manifest, read_row));
  return stack;
}

absl::Status check_rows(const FrameStack& stack, const std::vector<int>& needed) {
  const size_t samples =
      static_cast<size_t>(stack.row_count) * static_cast<size_t>(stack.manifest.camera().width_px()) * 3;
  for (const int frame : needed) {
    const auto at = static_cast<size_t>(frame);
    const size_t found = at < stack.rows.size() ? stack.rows[at].size() : 0;
    if (found != samples) {
      return absl::InvalidArgumentError(
          fmt::format("{} has {} samples in {} rows; the manifest's width of {} px makes that {}",
                      stack.manifest.frames(frame).file(), found, stack.row_count,
                      stack.manifest.camera().width_px(), samples));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Method>> make_method(const std::string& name, const MethodOptions& options) {
  if (name == "gaussian") return GaussianMethod::create(options);
  if (name == "fringe") return FringeMethod::create(options);
  return absl::InvalidArgumentError(fmt::format("method is \"{}\"; there is: gaussian, fringe", name));
}

}  // namespace glasswing
