// Raw photographs (DNG 1.4), written with libtiff.
#pragma once

#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/file/file.h"

namespace glasswing {

struct Dng {
  int width_px = 0, height_px = 0;  // of the sensor, masked borders included
  std::vector<std::uint16_t> codes;
  int bits = 16;
  std::string_view mosaic = "RGGB";
  std::vector<float> black = {0.0f};  // one, or four in rows of two
  std::uint32_t white = 65535;
  std::optional<std::array<std::uint32_t, 4>> active = {};  // top, left, bottom, right
  std::vector<std::uint16_t> linearisation = {};            // light by code
  std::uint16_t orientation = 1;
  double exposure_s = 0.0;  // 0: not told
  std::uint16_t iso = 0;
};

// Codes of `bits`, the first one highest; rows end at a byte.
inline std::vector<std::uint8_t> packed(const Dng& dng) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < dng.height_px; ++y) {
    std::uint32_t held = 0;
    int held_bits = 0;
    for (int x = 0; x < dng.width_px; ++x) {
      const std::uint16_t code = dng.codes[y * dng.width_px + x];
      if (dng.bits == 16) {  // in the order of the file's bytes
        bytes.push_back(static_cast<std::uint8_t>(code));
        bytes.push_back(static_cast<std::uint8_t>(code >> 8));
        continue;
      }
      held = held << dng.bits | code;
      for (held_bits += dng.bits; held_bits >= 8; held_bits -= 8)
        bytes.push_back(static_cast<std::uint8_t>(held >> (held_bits - 8)));
    }
    if (held_bits > 0) bytes.push_back(static_cast<std::uint8_t>(held << (8 - held_bits)));
  }
  return bytes;
}

inline void write_exif(TIFF* file, const Dng& dng) {
  TIFFCreateEXIFDirectory(file);
  TIFFSetField(file, EXIFTAG_EXPOSURETIME, dng.exposure_s);
  if (dng.iso > 0) TIFFSetField(file, EXIFTAG_ISOSPEEDRATINGS, 1, &dng.iso);
  std::uint64_t place = 0;
  TIFFWriteCustomDirectory(file, &place);
  TIFFSetDirectory(file, 0);
  TIFFSetField(file, TIFFTAG_EXIFIFD, place);
  TIFFRewriteDirectory(file);
}

inline void write_dng(const std::filesystem::path& path, const Dng& dng) {
  TIFF* const file = TIFFOpen(path.c_str(), "wl");
  TIFFSetField(file, TIFFTAG_DNGVERSION, "\1\4\0\0");
  TIFFSetField(file, TIFFTAG_DNGBACKWARDVERSION, "\1\1\0\0");
  TIFFSetField(file, TIFFTAG_SUBFILETYPE, 0);
  TIFFSetField(file, TIFFTAG_IMAGEWIDTH, dng.width_px);
  TIFFSetField(file, TIFFTAG_IMAGELENGTH, dng.height_px);
  TIFFSetField(file, TIFFTAG_BITSPERSAMPLE, dng.bits);
  TIFFSetField(file, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(file, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_CFA);
  TIFFSetField(file, TIFFTAG_COMPRESSION, COMPRESSION_NONE);
  TIFFSetField(file, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(file, TIFFTAG_ORIENTATION, dng.orientation);
  TIFFSetField(file, TIFFTAG_ROWSPERSTRIP, dng.height_px);
  TIFFSetField(file, TIFFTAG_MAKE, "Glasswing");
  TIFFSetField(file, TIFFTAG_MODEL, "Stand-in");
  TIFFSetField(file, TIFFTAG_UNIQUECAMERAMODEL, "Glasswing Stand-in");
  const std::uint16_t two_by_two[] = {2, 2}, one[] = {1, 1};
  std::array<std::uint8_t, 4> colours{};
  for (size_t i = 0; i < colours.size(); ++i)
    colours[i] = static_cast<std::uint8_t>(std::string_view("RGB").find(dng.mosaic[i]));
  TIFFSetField(file, TIFFTAG_CFAREPEATPATTERNDIM, two_by_two);
  TIFFSetField(file, TIFFTAG_CFAPATTERN, 4, colours.data());
  TIFFSetField(file, TIFFTAG_BLACKLEVELREPEATDIM, dng.black.size() == 4 ? two_by_two : one);
  TIFFSetField(file, TIFFTAG_BLACKLEVEL, static_cast<int>(dng.black.size()), dng.black.data());
  TIFFSetField(file, TIFFTAG_WHITELEVEL, 1, &dng.white);
  if (!dng.linearisation.empty()) {
    TIFFSetField(file, TIFFTAG_LINEARIZATIONTABLE, static_cast<int>(dng.linearisation.size()),
                 dng.linearisation.data());
  }
  if (dng.active) TIFFSetField(file, TIFFTAG_ACTIVEAREA, dng.active->data());
  const float matrix[] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, neutral[] = {1, 1, 1};
  TIFFSetField(file, TIFFTAG_COLORMATRIX1, 9, matrix);
  TIFFSetField(file, TIFFTAG_ASSHOTNEUTRAL, 3, neutral);
  std::vector<std::uint8_t> bytes = packed(dng);
  TIFFWriteRawStrip(file, 0, bytes.data(), static_cast<tmsize_t>(bytes.size()));
  if (dng.exposure_s > 0.0) {
    TIFFSetField(file, TIFFTAG_EXIFIFD, std::uint64_t{0});
    TIFFWriteDirectory(file);
    write_exif(file, dng);
  }
  TIFFClose(file);
}

}  // namespace glasswing
