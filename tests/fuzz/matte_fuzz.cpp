// decode_matte, of mattes and of delivery files, and joining of tiles.
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "compositing/deliver/delivery_file.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/matte/matte_file.h"
#include "core/matte/packed_matte.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

Matte matte_of(int width, int height, int modes) {
  Matte matte(0, 1, width, height, modes);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("s");
  matte.metadata.set_method("gaussian");
  matte.metadata.set_width_px(width);
  matte.metadata.set_height_px(height + 1);
  matte.metadata.add_monitors()->set_name("back");
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      matte.coverage(x, y) = static_cast<float>(x % 2);
      for (int c = 0; c < kChannels; ++c) {
        for (Mode& mode : matte.modes(x, y, c)) mode = {0.5f, 3.0f, 2.0f, 1.5f, 0.25f, 1.0f, 0};
      }
    }
  }
  return matte;
}

}  // namespace

std::vector<std::string> seeds() {
  std::vector<std::string> seeds{encode_matte(matte_of(3, 2, 1)).value(),
                                 encode_matte(matte_of(20, 18, 2)).value(),
                                 encode_matte(matte_of(2, 1, kMaxModes)).value()};
  // With matching checksums, so that only the later checks can refuse it.
  Matte matte = matte_of(3, 2, 1);
  matte.modes(1, 1, 1)[0].weight = std::numeric_limits<float>::quiet_NaN();
  seeds.push_back(encode_matte(matte).value());
  matte = matte_of(3, 2, 1);
  matte.modes(0, 0, 2)[0].texture = 1000;
  seeds.push_back(encode_matte(matte).value());
  matte = matte_of(3, 2, 1);
  matte.metadata.set_width_px(1000000);
  seeds.push_back(encode_matte(matte).value());
  matte = matte_of(3, 2, 1);
  matte.metadata.set_height_px(-5);
  seeds.push_back(encode_matte(matte).value());
  for (const DeliveryOptions& options : {DeliveryOptions{.half = true, .hug = true, .tile_px = 16},
                                         DeliveryOptions{.half = true, .hug = true, .tile_px = 0}}) {
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("matte_fuzz." + std::to_string(::getpid()) + ".exr");
    if (write_delivery(encode_matte(matte_of(20, 18, 2)).value(), options, file).ok())
      seeds.push_back(read_file(file).value());
    std::filesystem::remove(file);
  }
  return seeds;
}

void try_input(std::string_view input) {
  // The result is not checked: only crashes matter.
  const absl::StatusOr<MatteOutline> outline = outline_of(input);
  if (outline.ok()) {
    const auto put = [](std::uint64_t, std::string_view) { return absl::OkStatus(); };
    absl::StatusOr<PackedMatteWriter> writer = PackedMatteWriter::begin(*outline, put);
    const absl::Status joined = writer.ok() ? writer->add(input) : writer.status();
    FUZZ_CHECK(joined.ok() || !joined.message().empty());
  }
  const absl::StatusOr<Matte> matte = decode_matte(input);
  if (!matte.ok()) {
    FUZZ_CHECK(!matte.status().message().empty());
    return;
  }
  FUZZ_CHECK(matte->metadata.width_px() >= matte->x0_px() + matte->width_px());
  FUZZ_CHECK(matte->metadata.height_px() >= matte->y0_px() + matte->height_px());
  FUZZ_CHECK(matte->metadata.width_px() <= kMaxSide_px && matte->metadata.height_px() <= kMaxSide_px);
  for (int y = 0; y < matte->height_px(); ++y) {
    for (int x = 0; x < matte->width_px(); ++x) {
      FUZZ_CHECK(std::isfinite(matte->coverage(x, y)));
      for (int c = 0; c < kChannels; ++c) {
        for (const Mode& mode : matte->modes(x, y, c)) {
          FUZZ_CHECK(mode.weight >= 0.0f && std::isfinite(mode.x_px) && std::isfinite(mode.xy_px2));
          FUZZ_CHECK(mode.texture >= 0 && mode.texture < matte->metadata.monitors_size());
        }
      }
    }
  }
  FUZZ_CHECK(decode_matte(encode_matte(*matte).value()).ok());
}

}  // namespace glasswing::fuzz
