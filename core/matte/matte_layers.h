// The names of parts, layers and attributes in a matte file; docs/matte.md lists them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/matte/exr_writer.h"
#include "core/matte/matte.h"

namespace glasswing {

// Attributes. The checksums are on the first part.
inline constexpr const char* kMatteMetadata = "glasswing";
inline constexpr const char* kMatteConventions = "glasswing:conventions";
inline constexpr const char* kMatteRows = "glasswing:rows";
inline constexpr const char* kMatteChecksum = "glasswing:checksum";
inline constexpr const char* kMatteDelivery =
    "glasswing:delivery";  // of files for other programs: how written

// Parts of a file: the preview, the foreground, then one part per mode. A delivery file may have one more, of
// which object each pixel shows (compositing/deliver/cryptomatte.h).
inline constexpr size_t kPreviewPart = 0, kForegroundPart = 1, kFirstModePart = 2;
inline constexpr const char* kIdsPart = "object";

// A layer of a mode, in the order of docs/matte.md.
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
std::vector<ExrPart> matte_parts(int modes_per_channel, bool colourless, bool pyramids = false);
inline constexpr const char* kPyramidPart = "pyramid";
// Numbers of a row's pyramids, by pixel of its width.
inline constexpr int kPyramidPlanes = 512;
// Of one pyramid in its row.
int stored_size(const PyramidFootprint& pyramid);
// A channel of the first mode that only colourless mattes have.
std::string colourless_channel();

// Checksums of a file: one per row, over the pixels of all channels of all parts in order, and one over
// these, the metadata and all names.
inline constexpr size_t kRowChecksumDigits = 16;
std::string row_checksums(std::span<const std::uint64_t> rows);
std::string matte_checksum(const std::string& metadata, const std::vector<ExrPart>& parts,
                           const std::string& rows);
// Overwrites the text of an attribute in a file's headers, which must exist with a text of this length.
void put_attribute(std::string& exr, std::string_view name, std::string_view text);
// Sets the attributes of all parts.
void describe(std::vector<ExrPart>& parts, const std::string& metadata, const std::string& rows);

std::string json_of(const v1::MatteMetadata& metadata);

// A block of rows of a matte, as the planes of its file.
inline constexpr int kMaxBlockRows = 16;
class MatteBlock {
 public:
  MatteBlock(int modes_per_channel, bool colourless, int width_px, bool pyramids = false);

  // Copies rows between matte and planes, from y on, counted from the matte's first.
  void take(const Matte& matte, int y, int rows);
  void give(Matte& matte, int y, int rows) const;
  std::vector<std::uint64_t> checksums(int rows) const { return checksums(0, rows, 0, width_px_); }
  // Of a part of each row.
  std::vector<std::uint64_t> checksums(int first_row, int rows, int first_column, int columns) const;
  void clear() { std::ranges::fill(values_, 0.0f); }
  // Pointers to the first pixel of each channel of a part, in the order of matte_parts().
  std::span<float* const> planes(size_t part) const { return planes_[part]; }
  // The same for one row.
  std::vector<const float*> row(size_t part, int row) const;

 private:
  // The planes of a mode in one channel, by layer.
  std::span<float* const> layers(size_t mode, int channel) const;

  const int modes_, channels_, width_px_;
  std::vector<float> values_;
  std::vector<std::vector<float*>> planes_;
  std::array<float*, kChannels> preview_, foreground_;
  float *preview_coverage_, *coverage_, *flags_;
  std::vector<float*> layers_;
  // Of each row one list of numbers, plane by plane: for each pyramid x + 1, its channel, texture, F, noise,
  // prior, the number of coefficients, its left column and top row at level 0, then two numbers for each
  // coefficient; 0 ends it. One that finds no room is left out, and its pixel flagged.
  std::vector<float> pyramid_row(const Matte& matte, int row, std::vector<int>& left_out) const;
  void take_pyramids(const Matte& matte, int y, int rows);
  void give_pyramids(Matte& matte, int y, int rows) const;
  const bool pyramids_;
};

}  // namespace glasswing
