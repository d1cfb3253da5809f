// Archive::open, and reading rows from the result. The input is three files separated by lines of dashes:
// header.json, frames.jsonl, and a frame, which is stored under several names. @SUM@ in the journal is
// replaced by the frame's checksum, so that a mutated frame is not always refused for it.
#include <array>

#include "core/base/checksum.h"
#include "core/frame/archive.h"
#include "tests/core/frame/archive_rows.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kParting = "\n----\n";
constexpr std::string_view kSecret = "not of this archive";

std::array<std::string, 3> parts_of(std::string_view input) {
  std::array<std::string, 3> parts;
  for (size_t i = 0; i < 2; ++i) {
    const size_t at = input.find(kParting);
    if (at == std::string_view::npos) break;
    parts[i] = input.substr(0, at + 1);
    input.remove_prefix(at + kParting.size());
  }
  parts[2] = input;
  const std::string sum = checksum_of(parts[2]);
  for (size_t at = 0; (at = parts[1].find("@SUM@", at)) != std::string::npos;) parts[1].replace(at, 5, sum);
  return parts;
}

}  // namespace

std::vector<std::string> seeds() {
  Image16 image(5, 4);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(i * 977);
  const std::string header =
      R"({"format_version": 1, "session": "s", "camera": {"width_px": 5, "height_px": 4},
 "monitors": [{"name": "back", "width_px": 8, "height_px": 6}]})";
  const auto line = [](const std::string& file) {
    return R"({"file": ")" + file +
           R"(", "object": true, "stimulus": {"kind": "solid", "colour": [0, 0, 0], "panel": "back"}, )" +
           R"("exposure_ms": 4, "checksum": "@SUM@", "size_bytes": "376"})" + "\n";
  };
  const std::string parting(kParting);
  const std::string frames = line("frames/000000.tif") + line("frames/000001.tif");
  return {header + parting + frames + parting + encode_tiff(image),
          header + parting + line("../secret.tif") + parting + encode_tiff(image),
          header + parting + frames + parting + encode_tiff(Image16(4, 5)),
          R"({"format_version": 1, "camera": {"width_px": 16384, "height_px": 16384}})" + parting + frames +
              parting + encode_tiff(Image16(kMaxSide_px, 1)).substr(0, 256),
          header + parting + line("frames/000000.tif") + "{\"file\": \"frames/0000" + parting +
              encode_tiff(image)};
}

void try_input(std::string_view input) {
  const fs::path directory = scratch_directory() / "archive";
  fs::create_directories(directory / "frames");
  write_plainly(scratch_directory() / "secret.tif", kSecret);
  const std::array<std::string, 3> parts = parts_of(input);
  write_plainly(directory / "header.json", parts[0]);
  write_plainly(directory / "frames.jsonl", parts[1]);
  for (const char* name : {"frames/000000.tif", "frames/000001.tif"})
    write_plainly(directory / name, parts[2]);

  const absl::StatusOr<std::unique_ptr<Archive>> archive = Archive::open(directory);
  if (!archive.ok()) {
    FUZZ_CHECK(archive.status().message().find(directory.string()) != std::string_view::npos);
    return;
  }
  const v1::CaptureManifest manifest = (*archive)->manifest();
  const int height = manifest.camera().height_px();
  int read_count = 0;
  for (const v1::Frame& frame : manifest.frames()) {
    if (++read_count > 8) break;
    const absl::StatusOr<std::string> whole = read_rows(**archive, frame.file(), 0, height);
    const absl::StatusOr<std::string> last = read_rows(**archive, frame.file(), height - 1, 1);
    FUZZ_CHECK(whole.ok() == last.ok());
    FUZZ_CHECK(!read_rows(**archive, frame.file(), height, 1).ok());
    if (!whole.ok()) {
      FUZZ_CHECK(!whole.status().message().empty());
      continue;
    }
    FUZZ_CHECK(*whole != kSecret);
    FUZZ_CHECK(whole->size() ==
               static_cast<size_t>(manifest.camera().width_px()) * 6 * static_cast<size_t>(height));
    FUZZ_CHECK(whole->ends_with(*last));
    FUZZ_CHECK(parts[2].ends_with(*whole));
  }
}

}  // namespace glasswing::fuzz
