// Raw photographs, as cameras and users give them.
#include "core/frame/archive.h"
#include "core/image/mosaic.h"
#include "core/image/raw_photograph.h"
#include "tests/core/image/dng.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

std::string file_of(const Dng& dng) {
  const std::filesystem::path path = scratch_directory() / "seed.dng";
  write_dng(path, dng);
  return read_file(path).value();
}

}  // namespace

std::vector<std::string> seeds() {
  std::vector<std::string> seeds;
  for (const int bits : {8, 12, 14, 16}) {
    Dng dng{.width_px = 32, .height_px = 22, .codes = std::vector<std::uint16_t>(32 * 22), .bits = bits};
    dng.white = (1u << bits) - 1;
    for (size_t i = 0; i < dng.codes.size(); ++i)
      dng.codes[i] = static_cast<std::uint16_t>(i * 977 % (dng.white + 1));
    dng.black = {8.0f, 9.0f, 10.0f, 11.0f};
    if (bits == 12) dng.active = {{2, 4, 20, 30}};
    if (bits == 14) dng.exposure_s = 0.01;
    if (bits == 8) dng.linearisation = std::vector<std::uint16_t>(256, 40);
    seeds.push_back(file_of(dng));
  }
  return seeds;
}

void try_input(std::string_view input) {
  const absl::StatusOr<RawFacts> facts = read_raw_facts(input);
  FUZZ_CHECK(facts.ok() || !facts.status().message().empty());
  const absl::StatusOr<RawPhotograph> raw = decode_raw(input);
  if (!raw.ok()) {
    FUZZ_CHECK(!raw.status().message().empty());
    return;
  }
  FUZZ_CHECK(facts.ok());
  FUZZ_CHECK(raw->codes.channels == 1 && raw->codes.width_px >= 1 && raw->codes.width_px <= kMaxSide_px);
  FUZZ_CHECK(raw->codes.height_px >= 1 && raw->codes.height_px <= kMaxSide_px);
  FUZZ_CHECK(raw->white > raw->black && raw->black >= 0 && raw->white <= 65535);
  FUZZ_CHECK(raw->mosaic.empty() || Mosaic::parse(raw->mosaic).ok());
}

}  // namespace glasswing::fuzz
