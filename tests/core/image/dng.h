// Raw photographs (DNG 1.4), written with libtiff.
#pragma once

#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
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
  int tile_px = 0;    // 0: one strip
  bool jpeg = false;  // lossless
  bool mono = false;  // a sensor without colours
};

// A part of the sensor; beyond its edge, codes are 0.
struct DngTile {
  int left = 0, top = 0, width_px = 0, height_px = 0;
};

inline std::uint16_t code_at(const Dng& dng, int x, int y) {
  return x < dng.width_px && y < dng.height_px ? dng.codes[y * dng.width_px + x] : std::uint16_t{0};
}

// Codes of `bits`, the first one highest; rows end at a byte.
inline std::vector<std::uint8_t> packed(const Dng& dng, const DngTile& tile) {
  std::vector<std::uint8_t> bytes;
  for (int y = tile.top; y < tile.top + tile.height_px; ++y) {
    std::uint32_t held = 0;
    int held_bits = 0;
    for (int x = tile.left; x < tile.left + tile.width_px; ++x) {
      const std::uint16_t code = code_at(dng, x, y);
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

// ITU-T T.81, process 14: one component, predicted from the left; all differences' lengths have codes of 5
// bits.
inline std::vector<std::uint8_t> lossless_jpeg(const Dng& dng, const DngTile& tile) {
  const auto byte_of = [](int value) { return static_cast<std::uint8_t>(value); };
  std::vector<std::uint8_t> bytes;
  for (const int value :
       {0xff, 0xd8, 0xff, 0xc4, 0, 2 + 17 + 17, 0, 0, 0, 0, 0, 17, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0})
    bytes.push_back(byte_of(value));
  for (int length = 0; length <= 16; ++length) bytes.push_back(byte_of(length));
  for (const int value : {0xff,
                          0xc3,
                          0,
                          11,
                          dng.bits,
                          tile.height_px >> 8,
                          tile.height_px & 255,
                          tile.width_px >> 8,
                          tile.width_px & 255,
                          1,
                          1,
                          0x11,
                          0,
                          0xff,
                          0xda,
                          0,
                          8,
                          1,
                          1,
                          0,
                          1,
                          0,
                          0})
    bytes.push_back(byte_of(value));
  std::uint64_t held = 0;
  int held_bits = 0;
  const auto put = [&](std::uint32_t value, int bits) {
    held = held << bits | value;
    for (held_bits += bits; held_bits >= 8; held_bits -= 8) {
      bytes.push_back(static_cast<std::uint8_t>(held >> (held_bits - 8)));
      if (bytes.back() == 0xff) bytes.push_back(0);
    }
  };
  for (int y = tile.top; y < tile.top + tile.height_px; ++y) {
    for (int x = tile.left; x < tile.left + tile.width_px; ++x) {
      const int before = x > tile.left  ? code_at(dng, x - 1, y)
                         : y > tile.top ? code_at(dng, x, y - 1)
                                        : 1 << (dng.bits - 1);
      const int difference = static_cast<std::int16_t>(code_at(dng, x, y) - before);
      int length = 0;
      while (std::abs(difference) >> length != 0) ++length;
      put(static_cast<std::uint32_t>(length), 5);
      if (length > 0 && length < 16)
        put(static_cast<std::uint32_t>(difference > 0 ? difference : difference + (1 << length) - 1), length);
    }
  }
  put(0x7f, 7);
  bytes.push_back(0xff);
  bytes.push_back(0xd9);
  return bytes;
}

// Of the file's only directory: libtiff's own encoder knows no lossless JPEG.
inline void set_compression(const std::filesystem::path& path, std::uint8_t compression) {
  std::string bytes = read_file(path).value();
  const std::string_view none("\x03\x01\x03\x00\x01\x00\x00\x00\x01", 9);  // tag 259, a short: 1
  bytes.at(bytes.find(none) + 8) = static_cast<char>(compression);
  std::ofstream(path, std::ios::binary) << bytes;
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

inline void write_codes(TIFF* file, const Dng& dng) {
  const auto coded = [&](const DngTile& tile) {
    return dng.jpeg ? lossless_jpeg(dng, tile) : packed(dng, tile);
  };
  if (dng.tile_px == 0) {
    std::vector<std::uint8_t> bytes =
        coded({.left = 0, .top = 0, .width_px = dng.width_px, .height_px = dng.height_px});
    TIFFWriteRawStrip(file, 0, bytes.data(), static_cast<tmsize_t>(bytes.size()));
    return;
  }
  std::uint32_t number = 0;
  for (int y = 0; y < dng.height_px; y += dng.tile_px) {
    for (int x = 0; x < dng.width_px; x += dng.tile_px) {
      std::vector<std::uint8_t> bytes =
          coded({.left = x, .top = y, .width_px = dng.tile_px, .height_px = dng.tile_px});
      TIFFWriteRawTile(file, number++, bytes.data(), static_cast<tmsize_t>(bytes.size()));
    }
  }
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
  TIFFSetField(file, TIFFTAG_PHOTOMETRIC, dng.mono ? 34892 /* linear raw */ : PHOTOMETRIC_CFA);
  TIFFSetField(file, TIFFTAG_COMPRESSION, COMPRESSION_NONE);
  TIFFSetField(file, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(file, TIFFTAG_ORIENTATION, dng.orientation);
  if (dng.tile_px > 0) {
    TIFFSetField(file, TIFFTAG_TILEWIDTH, dng.tile_px);
    TIFFSetField(file, TIFFTAG_TILELENGTH, dng.tile_px);
  } else {
    TIFFSetField(file, TIFFTAG_ROWSPERSTRIP, dng.height_px);
  }
  TIFFSetField(file, TIFFTAG_MAKE, "Glasswing");
  TIFFSetField(file, TIFFTAG_MODEL, "Stand-in");
  TIFFSetField(file, TIFFTAG_UNIQUECAMERAMODEL, "Glasswing Stand-in");
  const std::uint16_t two_by_two[] = {2, 2}, one[] = {1, 1};
  std::array<std::uint8_t, 4> colours{};
  for (size_t i = 0; i < colours.size(); ++i)
    colours[i] = static_cast<std::uint8_t>(std::string_view("RGB").find(dng.mosaic[i]));
  if (!dng.mono) {
    TIFFSetField(file, TIFFTAG_CFAREPEATPATTERNDIM, two_by_two);
    TIFFSetField(file, TIFFTAG_CFAPATTERN, 4, colours.data());
  }
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
  write_codes(file, dng);
  if (dng.exposure_s > 0.0) {
    TIFFSetField(file, TIFFTAG_EXIFIFD, std::uint64_t{0});
    TIFFWriteDirectory(file);
    write_exif(file, dng);
  }
  TIFFClose(file);
  if (dng.jpeg) set_compression(path, 7);
}

}  // namespace glasswing
