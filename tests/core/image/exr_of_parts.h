// OpenEXR files written by hand, as OpenEXR's "Technical Introduction" and "File Layout" say: to have more
// parts than the library would write in reasonable time.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>

namespace glasswing {

// Black, 1 x 1 px, half floats, uncompressed. Each part has channels R, G, B and `further` others.
inline std::string exr_of_parts(int parts, int further = 0) {
  const auto word = [](std::uint64_t value, size_t size = 4) {
    std::string bytes;
    for (size_t i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> (8 * i) & 0xff));
    return bytes;
  };
  const auto named = [](const std::string& name) { return name + '\0'; };
  const auto attribute = [&](const char* name, const char* type, const std::string& value) {
    return named(name) + named(type) + word(value.size()) + value;
  };
  const std::string window(16, '\0'), one = word(0x3f800000);
  std::string channels, header;
  for (const char* name : {"B", "G", "R"}) channels += named(name) + word(1) + word(0) + word(1) + word(1);
  for (int i = 0; i < further; ++i)
    channels += named(fmt::format("x{:06}", i)) + word(1) + word(0) + word(1) + word(1);
  header += attribute("channels", "chlist", channels + '\0');
  header += attribute("compression", "compression", std::string(1, '\0'));
  header += attribute("dataWindow", "box2i", window) + attribute("displayWindow", "box2i", window);
  header += attribute("lineOrder", "lineOrder", std::string(1, '\0'));
  header += attribute("pixelAspectRatio", "float", one);
  header += attribute("screenWindowCenter", "v2f", std::string(8, '\0'));
  header += attribute("screenWindowWidth", "float", one);
  std::string file = word(20000630) + word(2 | (parts > 1 ? 0x1000 : 0));
  for (int part = 0; part < parts; ++part) {
    file += header;
    if (parts > 1) {
      file += attribute("name", "string", std::to_string(part)) +
              attribute("type", "string", "scanlineimage") + attribute("chunkCount", "int", word(1));
    }
    file += '\0';
  }
  if (parts > 1) file += '\0';
  const size_t row_bytes = 2 * (3 + static_cast<size_t>(further)),
               chunk_bytes = (parts > 1 ? 12 : 8) + row_bytes;
  const size_t first = file.size() + 8 * static_cast<size_t>(parts);
  for (int part = 0; part < parts; ++part) file += word(first + static_cast<size_t>(part) * chunk_bytes, 8);
  for (int part = 0; part < parts; ++part) {
    if (parts > 1) file += word(static_cast<std::uint64_t>(part));
    file += word(0) + word(row_bytes) + std::string(row_bytes, '\0');
  }
  return file;
}

}  // namespace glasswing
