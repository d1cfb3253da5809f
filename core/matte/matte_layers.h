// How a matte's parts, layers and attributes are called in its file; docs/matte.md lists them.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "core/matte/exr_writer.h"
#include "core/matte/matte.h"

namespace glasswing {

// Attributes. The checksums are on the first part.
inline constexpr const char* kMatteMetadata = "glasswing";
inline constexpr const char* kMatteConventions = "glasswing:conventions";
inline constexpr const char* kMatteRows = "glasswing:rows";
inline constexpr const char* kMatteChecksum = "glasswing:checksum";

// Parts of a file: the preview, the foreground, then a part of each mode.
inline constexpr size_t kPreviewPart = 0, kForegroundPart = 1, kFirstModePart = 2;

// Of a mode, in the order of docs/matte.md.
struct ModeLayer {
  const char* name;
  float Mode::*member;  // null: the texture
};
inline constexpr std::array<ModeLayer, 9> kModeLayers{{{"weight", &Mode::weight},
                                                       {"x", &Mode::x_px},
                                                       {"y", &Mode::y_px},
                                                       {"xx", &Mode::xx_px2},
                                                       {"xy", &Mode::xy_px2},
                                                       {"yy", &Mode::yy_px2},
                                                       {"texture", nullptr},
                                                       {"weight_sd", &Mode::weight_sd},
                                                       {"centre_sd", &Mode::centre_sd_px}}};

// Without attributes.
std::vector<ExrPart> matte_parts(int modes_per_channel, bool colourless);
// A channel of the first mode that only mattes have whose modes are alike in all colours.
std::string colourless_channel();

// Checksums of a file: of each row's pixels, all channels of all parts one after another, and one over those,
// the metadata and all names.
inline constexpr size_t kRowChecksumDigits = 16;
std::string row_checksums(std::span<const std::uint64_t> rows);
std::string matte_checksum(const std::string& metadata, const std::vector<ExrPart>& parts,
                           const std::string& rows);
// Puts all attributes in.
void describe(std::vector<ExrPart>& parts, const std::string& metadata, const std::string& rows);

std::string json_of(const v1::MatteMetadata& metadata);

// Some rows of a matte as its file's planes.
inline constexpr int kMaxBlockRows = 16;
class MatteBlock {
 public:
  MatteBlock(int modes_per_channel, bool colourless, int width_px);

  // Rows from y on, counted from the matte's own first.
  void take(const Matte& matte, int y, int rows);
  void give(Matte& matte, int y, int rows) const;
  std::vector<std::uint64_t> checksums(int rows) const;
  // The first pixel of each of a part's channels, in the order of matte_parts().
  std::span<float* const> planes(size_t part) const { return planes_[part]; }
  // As planes(), of one row of them.
  std::vector<const float*> row(size_t part, int row) const;

 private:
  // Of a mode in a channel, by layer.
  std::span<float* const> layers(size_t mode, int channel) const;

  const int modes_, channels_, width_px_;
  std::vector<float> values_;
  std::vector<std::vector<float*>> planes_;
  std::array<float*, kChannels> preview_, foreground_;
  float *preview_coverage_, *coverage_, *flags_;
  std::vector<float*> layers_;
};

}  // namespace glasswing
